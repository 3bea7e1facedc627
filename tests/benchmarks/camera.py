"""Kannala-Brandt lens against OpenCV's fisheye module: milliseconds for a million points.

Accuracy: the largest error of a direction after projection and back, in mrad, to 80° and to 110°
from the axis; OpenCV's own way back is to the tangent plane, from which the direction is made.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.models.kannala_brandt import KannalaBrandt

COUNT = 1_000_000
TERMS = (0.03, -0.012, 0.003, -0.0004)
FOCAL, CENTRE = (320.0, 321.0), (511.5, 510.0)
MODEL = KannalaBrandt(CENTRE, FOCAL, *TERMS)
MATRIX = np.array([[FOCAL[0], 0, CENTRE[0]], [0, FOCAL[1], CENTRE[1]], [0, 0, 1]])

Array = NDArray[np.float64]
Mapping = Callable[[Array], Array]


def opencv_project(directions: Array) -> Array:
    """Return the pixels (n, 2) of directions (n, 3)."""
    still = np.zeros(3)
    return cv2.fisheye.projectPoints(directions[None], still, still, MATRIX, np.array(TERMS))[0][0]


def opencv_unproject(pixels: Array) -> Array:
    """Return the unit directions (n, 3) of pixels (n, 2)."""
    plane = cv2.fisheye.undistortPoints(pixels[None], MATRIX, np.array(TERMS))[0]
    directions = np.column_stack([plane, np.ones(len(plane))])
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def rays(limit_deg: float) -> Array:
    """Return unit directions (COUNT, 3), uniform in angle and azimuth."""
    rng = np.random.default_rng(4)
    angle, azimuth = np.radians(limit_deg) * rng.random(COUNT), 2 * np.pi * rng.random(COUNT)
    sine = np.sin(angle)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(angle)], axis=1)


def largest_error_mrad(project: Mapping, unproject: Mapping, directions: Array) -> float:
    """Return how far the worst direction is from itself, there and back."""
    apart = np.linalg.norm(unproject(project(directions)) - directions, axis=1)
    return float(2e3 * np.arcsin(min(np.max(apart) / 2, 1.0)))


def run(repeats: int) -> list[dict[str, Any]]:
    """Time both systems in turns, and return the rows that bench.py writes."""
    near, wide = rays(80.0), rays(110.0)
    systems: dict[str, tuple[Mapping, Mapping]] = {
        "fishlight": (lambda d: MODEL.project(d)[0], lambda p: MODEL.unproject(p)[0]),
        "cv2.fisheye": (opencv_project, opencv_unproject),
    }
    pixels = MODEL.project(near)[0]
    times: dict[tuple[str, str], list[float]] = {}
    for repeat in range(repeats + 1):
        for name, (project, unproject) in systems.items():
            for case, mapping, points in (
                ("project", project, near),
                ("unproject", unproject, pixels),
            ):
                start = time.perf_counter()
                mapping(points)
                if repeat > 0:  # the first call warms up
                    elapsed = 1e3 * (time.perf_counter() - start)
                    times.setdefault((case, name), []).append(elapsed)
    medians = {key: statistics.median(values) for key, values in times.items()}
    accuracy = {
        name: {
            "worst to 80° mrad": largest_error_mrad(*mappings, near),
            "worst to 110° mrad": largest_error_mrad(*mappings, wide),
        }
        for name, mappings in systems.items()
    }
    return [
        {
            "stage": "camera",
            "case": f"{case} 10⁶ points",
            "system": name,
            "ms": ms,
            "ratio": ms / medians[case, "fishlight"] if name != "fishlight" else None,
            "accuracy": accuracy[name],
        }
        for (case, name), ms in medians.items()
    ]


if __name__ == "__main__":
    for row in run(15):
        print(row)
