"""The map around what a picture shows, found along its rays: behind it, and through the ground.

As render/rays/background.py, for views that change: nothing is computed beforehand.

Cost   : about 30 ns a pixel that shows the map.
Fails  : where it is looked up is off by up to 1e-6 of its width, as map_places.py.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.lights.map_places import angle_of
from render.rays.background import between, corners_of
from render.rays.row_order import row_order
from render.rays.surface_rows import GROUND, KIND, NOTHING, POSITION, SIDE

_FLOATS = NDArray[np.float32]

_TURNS = np.float32(0.5 / math.pi)  # in a radian


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def mark_surfaces(surfaces: _FLOATS, picture: _FLOATS) -> None:  # pragma: no cover - compiled
    """Set `picture` (H, W, 4) to black, alpha 1 where a surface is seen."""
    for line in prange(picture.shape[0]):
        for x in range(SIDE):
            kinds = surfaces[1 + line // SIDE, SIDE * (line % SIDE) + x, KIND]
            for column in range(x, picture.shape[1], SIDE):
                for c in range(3):
                    picture[line, column, c] = 0
                picture[line, column, 3] = np.float32(kinds[1 + column // SIDE] != NOTHING)


def show_map(
    surfaces: _FLOATS,
    eye: NDArray[np.float64],
    radiance: _FLOATS,
    unshaded: _FLOATS | None,
    picture: _FLOATS,
) -> None:
    """Set pixels to a map (N, 2N, 3) where nothing is seen, and those of the ground through it.

    The ground's are what the map shows there, in the shadow that they are in, as
    `background.look_through` has it; `unshaded` (3,) is the ground's radiance without shadow, None
    where it is to stay.
    """
    opaque = np.full(3, np.nan, np.float32)
    _show_map(
        surfaces, eye.astype(np.float32), np.ascontiguousarray(radiance),
        opaque if unshaded is None else unshaded, picture,
    )  # fmt: skip


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _show_map(
    surfaces: _FLOATS,
    eye: _FLOATS,
    radiance: _FLOATS,
    unshaded: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Do what `show_map` does; `unshaded` is NaN where the ground is to stay."""
    order = row_order(0, picture.shape[0])
    for k in prange(len(order)):
        line = order[k]
        for side in range(SIDE):
            seen = surfaces[1 + line // SIDE, SIDE * (line % SIDE) + side]
            for column in range(side, picture.shape[1], SIDE):
                at = 1 + column // SIDE
                is_ground = seen[KIND, at] == GROUND and not math.isnan(unshaded[0])
                if seen[KIND, at] != NOTHING and not is_ground:
                    continue
                x, y, z = seen[POSITION, at], seen[POSITION + 1, at], seen[POSITION + 2, at]
                if is_ground:
                    x, y, z = x - eye[0], y - eye[1], z - eye[2]
                u = np.float32(0.5) - _TURNS * angle_of(x, z)
                v = np.float32(2) * _TURNS * angle_of(np.float32(math.sqrt(x * x + z * z)), y)
                cells = corners_of(radiance.shape[0], radiance.shape[1], (u, v))
                for c in range(3):
                    shade = np.float32(1)
                    if is_ground and unshaded[c] > 0:
                        shade = picture[line, column, c] / unshaded[c]
                    picture[line, column, c] = shade * between(radiance, cells, c)
