"""Counts from any file that holds a frame: a picture, a RAW file, or linear radiance.

Input  : a file.    Output : counts (H, W, 3), and the Sensor that explains them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.pictures import PICTURE_SUFFIXES, read_picture
from capture.radiance_files import HDR_SUFFIXES, read_hdr
from capture.raw import RAW_SUFFIXES, RawFacts, raw_sensor, read_raw
from capture.sensor import Sensor, assumed_sensor

FRAME_SUFFIXES = PICTURE_SUFFIXES | RAW_SUFFIXES | HDR_SUFFIXES


@dataclass(frozen=True, eq=False)
class CameraFile:
    """A frame as its file holds it.

    Attributes
    ----------
    counts : (H, W, 3) uint8, uint16 or float32
        Float for radiance files, as stored, NaN where the file marks a pixel as not valid.
    clipped : (H, W) bool, or None
        Pixels that a radiance file marks as lower bounds; None where there is no mark.
    raw : RawFacts or None
        What a RAW file says of its counts.
    """

    counts: NDArray[Any]
    clipped: NDArray[np.bool_] | None = None
    raw: RawFacts | None = None

    def sensor(self) -> Sensor:
        """Return the sensor, from the header of a RAW file, assumed for anything else."""
        return assumed_sensor(self.counts.dtype) if self.raw is None else raw_sensor(self.raw)


def read_camera_file(path: Path) -> CameraFile:
    """Return the counts of a file, and what it tells of them.

    Raises
    ------
    UnreadableFrame
        If the file cannot be decoded in full.
    InputError
        If the file does not exist or its suffix is not of FRAME_SUFFIXES.
    """
    suffix = path.suffix.lower()
    if suffix in RAW_SUFFIXES:
        counts, facts = read_raw(path)
        return CameraFile(counts, raw=facts)
    if suffix in PICTURE_SUFFIXES:
        return CameraFile(read_picture(path))
    if suffix in HDR_SUFFIXES:
        return CameraFile(*_radiance(path))
    raise InputError(
        f"{path}: {path.suffix or 'no suffix'} is no format of a frame; "
        f"known are {', '.join(sorted(FRAME_SUFFIXES))}"
    )


def _radiance(path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_] | None]:
    picture = read_hdr(path)
    if picture.valid is None:
        return picture.rgb, picture.clipped
    rgb = np.where(picture.valid[..., None], picture.rgb, np.float32(np.nan))
    return rgb, picture.clipped
