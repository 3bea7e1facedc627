"""Rays through random places of pixels, and numbers that look random.

Every number is a hash of what it is for, so that a picture does not depend on threads or order.

References
----------
.. [1] G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA, 2014:
       SplitMix64.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.rays.embree import PACKET
from render.scenes.scene import Camera

Floats = NDArray[np.float32]

SIDE = 4
"""Pixels along the side of a tile: 16, a packet."""

_TO_UNIT = 1 / 2.0**32


def view_of(camera: Camera) -> Floats:
    """Return the eye, the direction toward the upper left corner, what a column and a row add."""
    right, up, backward = camera.axes()
    across, half_height = camera.half_extent()
    width, height = camera.size_px
    corner = half_height * up - across * right - backward
    return np.array(
        [camera.eye, corner, 2 * across / width * right, -2 * half_height / height * up], np.float32
    )


@njit(nogil=True)
def aim(
    view: Floats,
    x: int,
    y: int,
    width: int,
    height: int,
    side: int,
    point: int,
    random: np.uint64,
    rays: Floats,
) -> NDArray[np.int32]:  # pragma: no cover - compiled
    """Set rays through a random place in square `point` of each pixel; return which are pixels."""
    inside = np.empty(PACKET, np.int32)
    for i in range(PACKET):
        column, row = x + i % SIDE, y + i // SIDE
        right, down = pair(mixed(random + np.uint64(i << 32)))
        across = np.float32(column + (point % side + right) / side)
        along = np.float32(row + (point // side + down) / side)
        for axis in range(3):
            rays[axis, i] = view[0, axis]
            rays[4 + axis, i] = view[1, axis] + across * view[2, axis] + along * view[3, axis]
        inside[i] = -np.int32(column < width and row < height)
    return inside


@njit(nogil=True)
def mixed(state: np.uint64) -> np.uint64:  # pragma: no cover - compiled
    """Return a hash of 64 bits: SplitMix64's step and finaliser [1]_."""
    z = state + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(nogil=True)
def pair(bits: np.uint64) -> tuple[float, float]:  # pragma: no cover - compiled
    """Return two numbers in [0, 1) of 32 bits each."""
    low = bits & np.uint64(0xFFFFFFFF)
    return np.float64(bits >> np.uint64(32)) * _TO_UNIT, np.float64(low) * _TO_UNIT
