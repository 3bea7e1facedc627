"""Frames as small linear pictures, for questions that do not need every pixel."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.frame import Frame
from capture.sensor import Sensor


def reduction(size_px: tuple[int, int], most_px: int) -> int:
    """Return by how many whole pixels to reduce both sides, so that at most `most_px` remain."""
    wanted = math.ceil(math.sqrt(math.prod(size_px) / most_px))
    return min(wanted, *size_px)


def reduced_linear(frame: Frame, sensor: Sensor, step: int) -> NDArray[np.float32]:
    """Return linear values, (H // step, W // step, 3), averaged over `step` by `step` pixels."""
    table = sensor.linear_table()
    width, height = (length // step for length in frame.size_px)
    counts = frame.counts[: height * step, : width * step]
    return np.stack(
        [
            cv2.resize(
                table[counts[..., channel], channel],
                (width, height),
                interpolation=cv2.INTER_AREA,
            )
            for channel in range(3)
        ],
        axis=-1,
    ).astype(np.float32, copy=False)


def reduced_brightest(counts: NDArray[Any], step: int) -> NDArray[Any]:
    """Return the largest of `step` by `step` counts, (H // step, W // step, 3)."""
    height, width = (length // step * step for length in counts.shape[:2])
    parts = [
        counts[row:height:step, column:width:step] for row in range(step) for column in range(step)
    ]
    brightest = parts[0].copy()
    for part in parts[1:]:
        np.maximum(brightest, part, out=brightest)
    return brightest
