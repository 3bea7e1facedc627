"""Directions and maps as other programs take them: turned, rolled, never mirrored.

Domain : the world frame and the lat-long grid of CONVENTIONS.md.
Output : maps in another program's convention, directions with +Z up, quaternions (w, x, y, z).
A program with +Z up gets (x, y, z) as (x, −z, y), as the importers of Blender and others turn
scenes with +Y up: lights, dome and imported objects then fit together.
Fails  : maps of an odd number of rows cannot be rolled by a quarter, and are refused.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap

Convention = Literal["exr", "mitsuba", "usd", "blender", "three"]
"""The first three show +Z in the middle of the map, as fishlight does; the others our +X, which is
also Blender's once its world is turned to +Z up."""

_QUARTER_TURNS: dict[Convention, int] = {"exr": 0, "mitsuba": 0, "usd": 0, "blender": 1, "three": 1}


def in_convention(environment: EnvironmentMap, convention: Convention) -> EnvironmentMap:
    """Return the map rolled so that this program shows everything where it was.

    Raises
    ------
    InputError
        If the map has to be rolled by a quarter of its columns and their number is odd.
    """
    quarter, rest = divmod(environment.height, 2)
    columns = _QUARTER_TURNS[convention] * quarter
    if rest and columns:
        raise InputError(
            f"a map of {environment.height} rows cannot be turned by a quarter for {convention}: "
            "their number must be even; `fishlight remap --height` makes such a map"
        )
    if columns == 0:
        return environment
    return replace(
        environment,
        radiance=np.roll(environment.radiance, columns, axis=1),
        valid=np.roll(environment.valid, columns, axis=1),
        clipped=np.roll(environment.clipped, columns, axis=1),
    )


def z_up(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return world directions (..., 3) in a right-handed frame whose +Z is our +Y."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([x, -z, y], axis=-1)


def quaternions(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shortest turns of +Z into unit vectors (K, 3), as (K, 4): w, x, y, z.

    A lamp that shines along its own −Z then stands on the side of the direction and shines back
    along it.
    """
    x, y, z = directions.T
    half_angle = np.arctan2(np.hypot(x, y), z) / 2
    azimuth = np.arctan2(y, x)  # 0 on the axis, where any turn will do
    sine = np.sin(half_angle)
    axis_x, axis_y = -np.sin(azimuth), np.cos(azimuth)  # along +Z × d
    return np.stack([np.cos(half_angle), sine * axis_x, sine * axis_y, np.zeros_like(z)], axis=-1)
