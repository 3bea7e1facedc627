"""Recordings of noise, and all that is in a folder."""

from pathlib import Path

import numpy as np

from capture.frame import Exposure
from capture.recording import Recording, open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor

SENSOR = assumed_sensor(np.uint8)
RNG = np.random.default_rng(7)


def noise(dtype=np.uint8, size=(6, 8)):
    return RNG.integers(0, np.iinfo(dtype).max, (*size, 3), dtype, endpoint=True)


def record(folder: Path, pictures, times_s=(0.01,), timestamps_s=None, **options) -> Recording:
    """Write pictures as brackets of `times_s` and open the result."""
    sensor = assumed_sensor(pictures[0].dtype) if pictures else SENSOR
    with create_recording(folder, "test camera", sensor, **options) as writer:
        for index, picture in enumerate(pictures):
            timestamp_s = index / 10 if timestamps_s is None else timestamps_s[index]
            exposure = Exposure(times_s[index % len(times_s)], 2.0, 5.6)
            writer.write_frame(picture, exposure, timestamp_s, index // len(times_s))
    return open_recording(folder)


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }
