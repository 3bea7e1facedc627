"""From a camera's radiance picture to lights, by the shortest way that the method allows.

Input  : a RadianceImage and the Calibration of its camera.    Output : a LightSet.
Methods that take block sums get them straight from the picture (source_blocks.py); the others get
an environment map (remap.py).
Cost   : for one picture mostly that of finding out where its pixels look, about a second a
megapixel. A session does that once: `build_source_blocks`, then `apply_source_blocks` and
`reduce_to_lights` for each picture.
"""

from calibration.camera import Calibration
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.blocks.fill import Fill, fill_blocks, fill_unseen
from lighting.blocks.source_blocks import picture_blocks
from lighting.light_set import LightSet
from lighting.maps.remap_image import remap_image
from lighting.reduce import ADAPTIVE, BLOCK_METHODS, reduce_to_lights

_MAP_HEIGHT = 512


def reduce_picture_to_lights(
    calibration: Calibration,
    image: RadianceImage,
    count: int,
    method: str = ADAPTIVE,
    *,
    error: float | None = None,
    fill: Fill = "black",
    timestamp_s: float = 0.0,
    source: str = "",
) -> LightSet:
    """Return `count` distant lights for what a camera's picture shows.

    Parameters
    ----------
    calibration : Calibration
    image : RadianceImage
    count : int
        Number of lights, see `reduce_to_lights`.
    method : str
        A key of `METHODS`.
    error : float or None
        That as few lights as will do are to meet, see `reduce_to_lights`.
    fill : Fill
        What directions hold that the camera did not see.
    timestamp_s : float
        Moment of the picture.
    source : str
        What the picture is, for people.

    Raises
    ------
    InputError
        If the picture's size is not the calibration's, none of its valid pixels is seen, the count
        or the error is out of range, or there is no such method or fill.
    """
    if method in BLOCK_METHODS:
        blocks = fill_blocks(picture_blocks(calibration, image), fill)
        return reduce_to_lights(
            blocks, count, method, error=error, timestamp_s=timestamp_s, source=source
        )
    environment = remap_image(calibration, image, _MAP_HEIGHT)
    if not environment.valid.any():
        raise InputError(
            "the valid pixels of the picture cover no cell of the map by half; "
            "check that picture and calibration belong together"
        )
    environment = fill_unseen(environment, fill)
    return reduce_to_lights(
        environment, count, method, error=error, timestamp_s=timestamp_s, source=source
    )
