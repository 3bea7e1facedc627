"""The map around what a picture shows, found along its rays: behind it, and through the ground.

As render/rays/background.py, for views that change: nothing is computed beforehand.

Cost   : about 7 ns a pixel that shows the map.
Fails  : where it is looked up is off by up to 1e-6 of its width, as map_places.py.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.lights.map_places import angle_of
from render.loose_arithmetic import LOOSE
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
    through = NOTHING if math.isnan(unshaded[0]) else GROUND
    for k in prange(len(order)):
        line, columns = order[k], surfaces.shape[3]
        cells, shares = np.empty((2, columns), np.int32), np.empty((2, columns), np.float32)
        for side in range(SIDE):
            seen = surfaces[1 + line // SIDE, SIDE * (line % SIDE) + side]
            stop = 1 + (picture.shape[1] - side + SIDE - 1) // SIDE
            first = 1
            while first < stop and seen[KIND, first] > through:
                first += 1
            while stop > first and seen[KIND, stop - 1] > through:
                stop -= 1
            _find_cells(seen, eye, radiance.shape[0], first, stop, cells, shares)
            _show_lane(
                seen[KIND], radiance, unshaded, through, side, first, stop, cells, shares,
                picture[line],
            )  # fmt: skip


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _find_cells(
    seen: _FLOATS,
    eye: _FLOATS,
    rows: int,
    first: int,
    stop: int,
    cells: NDArray[np.int32],
    shares: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set which two cells of a row of the map a lane's pixels lie between, and how far.

    The rows of `cells` are the left and the right one, of `shares` how much the right one and the
    row below count, as `background.corners_of` has them.
    """
    half, zero = np.float32(0.5), np.float32(0)
    height, width = np.int32(rows), np.int32(2 * rows)
    for at in range(np.uint64(first), np.uint64(stop)):
        on_ground = np.float32(seen[KIND, at] == GROUND)
        x = seen[POSITION, at] - on_ground * eye[0]
        y = seen[POSITION + 1, at] - on_ground * eye[1]
        z = seen[POSITION + 2, at] - on_ground * eye[2]
        level = np.float32(math.sqrt(x * x + z * z))
        u = half - _TURNS * angle_of(x, z)
        v = np.float32(2) * _TURNS * angle_of(level, y)
        across, down = u * np.float32(width) - half, v * np.float32(height) - half
        down = min(max(down, zero), np.float32(height - 1))
        column, row = np.int32(across), min(np.int32(down), np.int32(height - 2))
        column -= np.int32(across < 0)  # down to a whole number
        shares[0, at], shares[1, at] = across - np.float32(column), down - np.float32(row)
        column += width if column < 0 else np.int32(0)
        beside = column + np.int32(1)
        cells[0, at] = row * width + column
        cells[1, at] = row * width + (beside if beside < width else np.int32(0))


@njit(nogil=True, error_model="numpy")
def _show_lane(
    kinds: _FLOATS,
    radiance: _FLOATS,
    unshaded: _FLOATS,
    through: float,
    side: int,
    first: int,
    stop: int,
    cells: NDArray[np.int32],
    shares: _FLOATS,
    line: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set a lane's pixels in a line (W, 4) of the picture to what lies between cells of the map."""
    every, below = radiance.reshape(-1, 3), np.uint64(radiance.shape[1])
    for at in range(np.uint64(first), np.uint64(stop)):
        if kinds[at] > through:
            continue
        left, beside = np.uint64(cells[0, at]), np.uint64(cells[1, at])
        right, down = shares[0, at], shares[1, at]
        near, high = np.float32(1) - right, np.float32(1) - down
        column = np.uint64(SIDE) * (at - np.uint64(1)) + np.uint64(side)
        for c in range(np.uint64(3)):
            shade = np.float32(1)
            if kinds[at] == GROUND and unshaded[c] > 0:
                shade = line[column, c] / unshaded[c]
            upper = near * every[left, c] + right * every[beside, c]
            lower = near * every[left + below, c] + right * every[beside + below, c]
            line[column, c] = shade * (high * upper + down * lower)
