"""Counts from any file that holds a frame: a picture, a RAW file, or linear radiance.

Input  : a file.    Output : counts (H, W, 3) and the Sensor that explains them.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.pictures import PICTURE_SUFFIXES, read_picture
from capture.radiance_files import HDR_SUFFIXES, read_hdr
from capture.raw import RAW_SUFFIXES, read_raw
from capture.sensor import Sensor, assumed_sensor

FRAME_SUFFIXES = PICTURE_SUFFIXES | RAW_SUFFIXES | HDR_SUFFIXES


def read_counts(path: Path) -> tuple[NDArray[Any], Sensor, NDArray[np.bool_] | None]:
    """Return the counts of a file, its sensor and its mark `clipped`, as far as the file tells.

    Returns
    -------
    counts : (H, W, 3) uint8, uint16 or float32
        Float for radiance files, as stored, NaN where the file marks a pixel as not valid.
    sensor : Sensor
        From the header of a RAW file, assumed for anything else.
    clipped : (H, W) bool, or None
        Pixels that a radiance file marks as lower bounds; None where there is no mark.

    Raises
    ------
    UnreadableFrame
        If the file cannot be decoded in full.
    InputError
        If the file does not exist or its suffix is not of FRAME_SUFFIXES.
    """
    suffix = path.suffix.lower()
    if suffix in RAW_SUFFIXES:
        return *read_raw(path), None
    clipped = None
    if suffix in PICTURE_SUFFIXES:
        counts = read_picture(path)
    elif suffix in HDR_SUFFIXES:
        counts, clipped = _radiance(path)
    else:
        raise InputError(
            f"{path}: {path.suffix or 'no suffix'} is no format of a frame; "
            f"known are {', '.join(sorted(FRAME_SUFFIXES))}"
        )
    return counts, assumed_sensor(counts.dtype), clipped


def _radiance(path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_] | None]:
    picture = read_hdr(path)
    if picture.valid is None:
        return picture.rgb, picture.clipped
    rgb = np.where(picture.valid[..., None], picture.rgb, np.float32(np.nan))
    return rgb, picture.clipped
