"""Directions at an angle from a model's axis, and between one another."""

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel

CENTRE = (319.7, 241.2)


def around_axis(model: CameraModel, angle: NDArray, azimuth: NDArray) -> NDArray[np.float64]:
    """Camera-frame directions at an angle from the model's axis."""
    sine = np.sin(angle)
    return np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth), model.axis_z * np.cos(angle)], axis=-1
    )


def angle_between(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))
