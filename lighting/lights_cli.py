"""`fishlight lights`: from an environment map, or a camera picture, to lights.json."""

from pathlib import Path

from calibration.files import read_calibration
from capture.arguments import Output, WholeNumber
from capture.errors import InputError
from capture.radiance import Cleaned
from capture.radiance_files import read_radiance
from lighting.environment_files import read_environment
from lighting.fill import Fill
from lighting.light_files import write_lights
from lighting.light_set import LightSet
from lighting.reduce import reduce_to_lights
from lighting.reduce_picture import reduce_picture_to_lights


def lights(
    picture: Path,
    *,
    output: Output,
    calibration: Path | None = None,
    count: WholeNumber = 64,
    method: str = "inverse-cdf",
    fill: Fill = "black",
    force: bool = False,
) -> None:
    """Reduce an environment map, or a camera's radiance picture, to distant lights.

    Parameters
    ----------
    picture
        Lat-long map, or with --calibration a camera's linear radiance; EXR or Radiance .hdr.
    output
        The lights, as JSON.
    calibration
        The calibration of the camera that took the picture, JSON.
    count
        Number of lights, at least 1.
    method
        How the lights are found: inverse-cdf, median-cut, variance-minimisation or cells.
    fill
        What directions hold that the camera did not see: black, mean (of the seen) or mirror (at
        the horizon). Only with --calibration: a map is filled by `fishlight remap`.
    force
        Replace the output if it exists.
    """
    if calibration is None:
        if fill != "black":
            raise InputError(
                "--fill is for a camera's picture, with --calibration; "
                "`fishlight remap --fill` fills a map"
            )
        environment, cleaned = read_environment(picture)
        light_set = reduce_to_lights(environment, count, method, source=picture.name)
    else:
        light_set, cleaned = _lights_of_picture(picture, calibration, count, method, fill)
    write_lights(output, light_set, force=force)

    red, green, blue = light_set.irradiance.sum(axis=0)
    print(
        f"{output}: {light_set.source}; total irradiance "
        f"{red:.4g} {green:.4g} {blue:.4g} ({light_set.scale} × sr)"
    )
    if str(cleaned):
        print(f"  set to 0 in the input: {cleaned} values")
    if light_set.clipped_fraction > 0:
        print(
            f"  {light_set.clipped_fraction:.1%} of the light comes from clipped pixels: "
            "the lights are a lower bound"
        )


def _lights_of_picture(
    picture: Path, calibration: Path, count: int, method: str, fill: Fill
) -> tuple[LightSet, Cleaned]:
    camera = read_calibration(calibration)
    image, cleaned = read_radiance(picture)
    camera.check_size(image.size_px, str(picture))
    light_set = reduce_picture_to_lights(
        camera, image, count, method, fill=fill, source=picture.name
    )
    return light_set, cleaned
