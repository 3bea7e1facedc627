"""`fishlight remap`: from a camera picture to an environment map."""

from pathlib import Path

import numpy as np

from calibration.files import read_calibration
from calibration.vignetting_record import correction_error, read_vignetting_record
from capture.arguments import Output, WholeNumber
from capture.errors import InputError
from capture.output import check_place
from capture.radiance_files import read_radiance
from lighting.blocks.fill import Fill, fill_unseen
from lighting.maps.environment_files import write_environment
from lighting.maps.remap_image import remap_image

_MAX_HEIGHT = 2048


def remap(
    radiance: Path,
    *,
    calibration: Path,
    output: Output,
    height: WholeNumber = 512,
    fill: Fill = "black",
    strict: bool = False,
    force: bool = False,
) -> None:
    """Turn a camera's radiance picture into a lat-long environment map.

    Parameters
    ----------
    radiance
        Linear radiance of the camera's picture, EXR or Radiance .hdr.
    calibration
        The camera's calibration, JSON.
    output
        The map, EXR or Radiance .hdr (which loses the marks of unseen and clipped cells).
    height
        Rows of the map; it has twice as many columns.
    fill
        What unseen directions hold: black, mean (of the seen) or mirror (at the horizon).
    strict
        Refuse a picture with NaN, infinite or negative values instead of setting them to 0.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    check_map_height(height)
    camera = read_calibration(calibration)
    image, cleaned = read_radiance(radiance)
    if strict:
        cleaned.refuse(radiance)
    camera.check_size(image.size_px, str(radiance))
    environment = remap_image(camera, image, height)
    if not environment.valid.any():
        raise InputError(
            f"{radiance}: its valid pixels cover no cell of the map by half; "
            f"check the picture, {calibration} and --height"
        )
    environment = fill_unseen(environment, fill)
    write_environment(output, environment, force=force)

    print(f"{output}: {2 * height}×{height}, {environment.seen_share:.1%} of all directions seen")
    for remark in cleaned.remarks:
        print(f"  {remark}")
    vignetting = read_vignetting_record(calibration)
    if vignetting is not None:
        share, angle_rad = correction_error(vignetting, camera)
        print(
            f"  vignetting is taken out to ±{share:.2%} at {np.degrees(angle_rad):.0f}° from the "
            "axis, where it is known least"
        )
    clipped_count = int(environment.clipped.sum())
    if clipped_count:
        print(f"  {clipped_count} cells are clipped: their radiance is a lower bound")


def check_map_height(height: int) -> None:
    """Raise InputError unless a map of `height` rows can be made."""
    if not 2 <= height <= _MAX_HEIGHT:
        raise InputError(f"--height must be 2 to {_MAX_HEIGHT}, got {height}")
