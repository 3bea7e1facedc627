"""Lights and maps turned about the vertical, as if the camera had been turned.

Domain : yaw in rad, counter-clockwise seen from above (+Y): it takes +Z toward +X.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import yaw_rotation
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics

_POINTS = 64  # more than harmonics: the fit of their turned values is exact


def turned_lights(lights: LightSet, yaw_rad: float) -> LightSet:
    """Return the lights, and their fill, turned by `yaw_rad`."""
    if yaw_rad == 0.0:
        return lights
    rotation = yaw_rotation(yaw_rad)
    points = _spread_points()
    back = harmonics.basis(points @ rotation)  # rows are R⁻¹ p
    turn = np.linalg.lstsq(harmonics.basis(points), back, rcond=None)[0]
    return replace(
        lights,
        directions=lights.directions @ rotation.T,
        fill=turn @ lights.fill if lights.fill.any() else lights.fill,
    )


def turned_map(environment: EnvironmentMap, yaw_rad: float) -> EnvironmentMap:
    """Return the map turned by `yaw_rad`, rounded to whole cells."""
    cells = -round(yaw_rad * environment.height / np.pi)
    if cells == 0:
        return environment
    return EnvironmentMap(
        np.roll(environment.radiance, cells, axis=1),
        np.roll(environment.valid, cells, axis=1),
        np.roll(environment.clipped, cells, axis=1),
        environment.scale,
    )


def _spread_points() -> NDArray[np.float64]:
    """Return unit vectors (_POINTS, 3) in a spiral from pole to pole."""
    y = 1 - (2 * np.arange(_POINTS) + 1) / _POINTS
    azimuth = np.pi * (1 + np.sqrt(5)) * np.arange(_POINTS)
    level = np.sqrt(1 - y**2)
    return np.stack([level * np.sin(azimuth), y, level * np.cos(azimuth)], axis=-1)
