"""A small recording with a calibration, and what a live session needs beside it."""

import json
from pathlib import Path

import numpy as np

from capture.frame import Exposure
from capture.recording import Recording, open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor

SIZE_PX = (64, 48)

CALIBRATION = {
    "model": "equidistant",
    "image_size_px": list(SIZE_PX),
    "centre_px": [31.5, 23.5],
    "focal_px": 20.0,
    "valid_angle_rad": 1.2,
}


def make_recording(
    folder: Path, brackets: int = 3, interval_s: float = 0.02, level: int = 90, lamp: bool = True
) -> Recording:
    """Write brackets of two exposures: a grey room, and a lamp that wanders to the right."""
    calibration = folder.parent / "cal.json"
    calibration.write_text(json.dumps(CALIBRATION))
    with create_recording(folder, "", assumed_sensor(np.uint8), calibration=calibration) as writer:
        for number in range(brackets):
            for time_s, counts in ((0.01, level), (0.001, level if level == 255 else level // 6)):
                picture = np.full((SIZE_PX[1], SIZE_PX[0], 3), counts, np.uint8)
                if lamp and level < 255:
                    column = 20 + number % 20
                    picture[18:22, column : column + 4] = 255 if time_s > 0.005 else 200
                writer.write_frame(picture, Exposure(time_s), number * interval_s, number)
    return open_recording(folder)
