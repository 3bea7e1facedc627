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


def read_counts(path: Path) -> tuple[NDArray[Any], Sensor]:
    """Return the counts of a file and its sensor, as far as the file tells.

    Returns
    -------
    counts : (H, W, 3) uint8, uint16 or float32
        Float for radiance files, as stored, NaN where the file marks a pixel as not valid. Its
        mark `clipped` is lost: a frame has no place for it.
    sensor : Sensor
        From the header of a RAW file, assumed for anything else.

    Raises
    ------
    UnreadableFrame
        If the file cannot be decoded in full.
    InputError
        If the file does not exist or its suffix is not of FRAME_SUFFIXES.
    """
    suffix = path.suffix.lower()
    if suffix in RAW_SUFFIXES:
        return read_raw(path)
    if suffix in PICTURE_SUFFIXES:
        counts = read_picture(path)
    elif suffix in HDR_SUFFIXES:
        counts = _radiance(path)
    else:
        raise InputError(
            f"{path}: {path.suffix or 'no suffix'} is no format of a frame; "
            f"known are {', '.join(sorted(FRAME_SUFFIXES))}"
        )
    return counts, assumed_sensor(counts.dtype)


def _radiance(path: Path) -> NDArray[np.float32]:
    picture = read_hdr(path)
    if picture.valid is None:
        return picture.rgb
    return np.where(picture.valid[..., None], picture.rgb, np.float32(np.nan))
