"""The map around what a picture shows, found along its rays: behind it, and through the ground.

As render/rays/background.py, for views that change: nothing is computed beforehand.

Cost   : about 60 ns a pixel that shows the map.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.background import bilinear
from render.rays.first_hits import GROUND, KIND, NOTHING, SIDE

_FLOATS = NDArray[np.float32]


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def mark_surfaces(surfaces: _FLOATS, picture: _FLOATS) -> None:  # pragma: no cover - compiled
    """Set `picture` (H, W, 4) to black, alpha 1 where a surface is seen."""
    for line in prange(picture.shape[0]):
        row, first = 1 + line // SIDE, SIDE * (line % SIDE)
        for column in range(picture.shape[1]):
            kind = surfaces[row, first + column % SIDE, KIND, 1 + column // SIDE]
            for c in range(3):
                picture[line, column, c] = 0
            picture[line, column, 3] = np.float32(kind != NOTHING)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def show_map(
    surfaces: _FLOATS,
    eye: _FLOATS,
    radiance: _FLOATS,
    unshaded: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set pixels to a map (N, 2N, 3) where nothing is seen, and those of the ground through it.

    The ground's are what the map shows there, in the shadow that they are in, as
    `background.look_through` has it; `unshaded` (3,) is NaN where the ground is to stay.
    """
    for line in prange(picture.shape[0]):
        row = 1 + line // SIDE
        for column in range(picture.shape[1]):
            lane, at = SIDE * (line % SIDE) + column % SIDE, 1 + column // SIDE
            kind = surfaces[row, lane, KIND, at]
            if kind != NOTHING and (kind != GROUND or math.isnan(unshaded[0])):
                continue
            x, y, z = (
                surfaces[row, lane, 0, at],
                surfaces[row, lane, 1, at],
                surfaces[row, lane, 2, at],
            )
            if kind == GROUND:
                x, y, z = x - eye[0], y - eye[1], z - eye[2]
            u = np.float32(0.5 - math.atan2(x, z) / (2 * math.pi))
            v = np.float32(math.atan2(math.hypot(x, z), y) / math.pi)
            for c in range(3):
                shade = np.float32(1)
                if kind == GROUND and unshaded[c] > 0:
                    shade = picture[line, column, c] / unshaded[c]
                picture[line, column, c] = shade * bilinear(radiance, (u, v), c)
