"""Irradiance without shadows, from a whole pool of directions: what a pixel's own few add to.

It is known at the normals of a grid, the four around a surface's normal stand for it, each for a
share. So does the cosine to a direction: the sum of the shares of each one's clamped cosine. That
sum has the irradiance so interpolated as its mean over the pool, exactly, however coarse the grid:
it is a control variate.

Domain : world frame; normals at the corners of a lat-long grid of `ROWS` rows, the poles included.
Cost   : 512 cosines of each direction of the pool, about 50 ms of one core for 65,536.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.reference.surfaces import NORMAL

Floats = NDArray[np.float32]

ROWS = 16
_RUN = 1024  # directions that float32 adds up, before float64 does

CORNERS = 12
"""Numbers that stand for a normal: four directions, each as long as its share."""


class Irradiance(NamedTuple):
    """Irradiance of surfaces that nothing shadows.

    Attributes
    ----------
    normals : (ROWS + 1, 2 ROWS, 3) float32
    received : (ROWS + 1, 2 ROWS, 3) float32
        Red, green, blue.
    """

    normals: Floats
    received: Floats


def irradiance_of(pool: Floats) -> Irradiance:
    """Return the irradiance from a pool (M, 8), as `draw_pool` returns it."""
    theta = np.pi * np.arange(ROWS + 1) / ROWS
    phi = np.pi * np.arange(2 * ROWS) / ROWS
    level = np.sin(theta)[:, None]
    level[-1] = 0.0
    x, z = level * np.sin(phi), level * np.cos(phi)
    y = np.broadcast_to(np.cos(theta)[:, None], x.shape)
    normals = np.stack([x, y, z], axis=-1).astype(np.float32)
    received = np.zeros_like(normals)
    _receive(np.ascontiguousarray(pool[:, :6].T), normals, received)
    return Irradiance(normals, received)


@njit(cache=True, nogil=True, parallel=True, fastmath={"contract", "reassoc", "nsz"})
def _receive(pool: Floats, normals: Floats, received: Floats) -> None:  # pragma: no cover
    count = pool.shape[1]
    for row in prange(normals.shape[0]):
        for column in range(normals.shape[1]):
            nx, ny, nz = normals[row, column]
            sums = np.zeros(3)
            for start in range(0, count, _RUN):
                red = green = blue = np.float32(0)
                for j in range(start, min(start + _RUN, count)):
                    cosine = nx * pool[0, j] + ny * pool[1, j] + nz * pool[2, j]
                    cosine = max(cosine, np.float32(0))
                    red += cosine * pool[3, j]
                    green += cosine * pool[4, j]
                    blue += cosine * pool[5, j]
                sums[0] += red
                sums[1] += green
                sums[2] += blue
            received[row, column] = sums / count


@njit(nogil=True)
def set_corners(
    smooth: Irradiance, surface: Floats, i: int, corners: Floats
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Set `corners` (CORNERS, 16) of column `i`, and return the irradiance they have."""
    x, y, z = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    level = math.sqrt(x * x + z * z)
    down = math.atan2(level, y) * (ROWS / math.pi)
    around = math.atan2(x, z) * (ROWS / math.pi) + 2 * ROWS if level > 0 else 0.0
    row, column = min(int(down), ROWS - 1), int(around)
    down, around = down - row, around - column
    red = green = blue = 0.0
    for k in range(4):
        share = (down if k // 2 else 1 - down) * (around if k % 2 else 1 - around)
        j, c = row + k // 2, (column + k % 2) % (2 * ROWS)
        for axis in range(3):
            corners[3 * k + axis, i] = share * smooth.normals[j, c, axis]
        red += share * smooth.received[j, c, 0]
        green += share * smooth.received[j, c, 1]
        blue += share * smooth.received[j, c, 2]
    return red, green, blue
