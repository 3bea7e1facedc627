"""Rendered pictures as files: PNG to look at, EXR to measure."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.exr import write_exr
from capture.pictures import write_png
from render.output.view import to_display

PICTURE_SUFFIXES = (".png", ".exr")


def write_picture(
    path: Path, radiance: NDArray[np.float32], exposure_ev: float, *, force: bool = True
) -> None:
    """Write a rendered picture, (H, W, 4) linear radiance and alpha.

    A PNG holds what `to_display` makes of it, without alpha; an EXR the float32 radiance as it is,
    without exposure, and alpha.

    Raises
    ------
    InputError
        For any other suffix, or if the file exists and `force` is False.
    """
    check_picture_suffix(path)
    if path.suffix.lower() == ".png":
        write_png(path, to_display(radiance, exposure_ev), force=force)
    else:
        channels = {name: radiance[..., index] for index, name in enumerate("RGBA")}
        write_exr(path, channels, {}, force=force)


def check_picture_suffix(path: Path) -> None:
    """Raise InputError unless `path` ends in a suffix that `write_picture` knows."""
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        raise InputError(f"{path}: a picture is written as {' or '.join(PICTURE_SUFFIXES)}")
