"""Where a picture shows nothing but ground: there, all neighbours of a pixel are on its surface.

Its normal is everywhere the same, so that a light gives every pixel the same without shadow. What a
pixel's rays let through is weighed once, and what its neighbours take over of it are sums.

Cost   : about 1 ns a pixel to find, 10 ns to shade by 64 lights.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.moving.light_weights import weigh_dull
from render.moving.neighbours import find_turns, low
from render.moving.shadow_rays import ALL_PASSES, turn_of
from render.rays.embree import PACKET
from render.rays.row_order import row_order
from render.rays.surface_rows import (
    FACE_NORMAL,
    FIELDS,
    GROUND,
    KIND,
    LANES,
    MATT,
    NORMAL,
    SIDE,
)

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FLAGS = NDArray[np.bool_]


def open_ground(surfaces: _FLOATS) -> _FLAGS:
    """Return in which tiles (rows, columns), and all eight around each, all pixels show ground."""
    is_ground = np.empty((surfaces.shape[0], surfaces.shape[3]), np.bool_)
    _find_ground(surfaces, is_ground)
    is_open = np.zeros_like(is_ground)
    inner = is_open[1:-1, 1:-1]
    inner[:] = True
    rows, columns = is_ground.shape
    for down in range(3):
        for right in range(3):
            inner &= is_ground[down : rows - 2 + down, right : columns - 2 + right]
    return is_open


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _find_ground(surfaces: _FLOATS, is_ground: _FLAGS) -> None:  # pragma: no cover - compiled
    for row in prange(surfaces.shape[0]):
        is_ground[row] = True
        for lane in range(LANES):
            for column in range(surfaces.shape[3]):
                is_ground[row, column] &= surfaces[row, lane, KIND, column] == GROUND


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def weigh_on_ground(
    is_open: _FLAGS,
    shared: _BYTES,
    lights: _FLOATS,
    key_count: int,
    side: int,
    up: float,
    weights: _FLOATS,
    weighed: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `weighed` (rows, LANES, 3, columns) to what pixels' rays let through on the ground.

    That is, of the irradiance by the lights whose turn each pixel is; and all of it without shadow
    is what `weights` (3, K) are set to. Tiles are left out that are no open ones' neighbours. `up`
    is the y of the ground's normal; `shared` and `lights` are as in `trace_lights`.
    """
    level = np.zeros((FIELDS, 1), np.float32)
    level[NORMAL + 1, 0] = level[FACE_NORMAL + 1, 0] = up
    weigh_dull(level, 0, lights, weights)
    order = row_order(1, is_open.shape[0] - 1)
    for k in prange(len(order)):
        row = order[k]
        for first in range(1, is_open.shape[1] - 1, PACKET):
            if is_open[row - 1 : row + 2, first - 1 : first + PACKET + 1].any():
                for lane in range(LANES):
                    start = key_count + turn_of(lane, side) * shared.shape[3]
                    if start < lights.shape[1]:
                        _weigh(shared, row, lane, first, weights, start, weighed)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _weigh(
    shared: _BYTES,
    row: int,
    lane: int,
    first: int,
    weights: _FLOATS,
    start: int,
    weighed: _FLOATS,
) -> None:  # pragma: no cover - compiled
    share, at, light = np.float32(1 / ALL_PASSES), np.uint64(first), np.uint64(start)
    for c in range(3):
        for i in range(np.uint64(PACKET)):
            total = np.float32(0)
            for slot in range(np.uint64(shared.shape[3])):
                total += weights[c, light + slot] * np.float32(shared[row, lane, at + i, slot])
            weighed[row, lane, c, at + i] = share * total


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_to_ground(
    is_open: _FLAGS,
    surfaces: _FLOATS,
    keys: _FLOATS,
    weights: _FLOATS,
    weighed: _FLOATS,
    is_soft: _FLAGS,
    side: int,
    turns: int,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add radiance to the pixels of `picture` (H, W, 4) that lie in open tiles.

    `weights` and `weighed` are as `weigh_on_ground` sets them, of lights in so many `turns`;
    `surfaces`, `keys` and `is_soft` as in `add_lights`.
    """
    order = row_order(1, is_open.shape[0] - 1)
    for k in prange(len(order)):
        row = order[k]
        if not is_open[row].any():
            continue
        total = np.empty((3, is_open.shape[1]), np.float32)
        near_of = np.empty(turns, np.int64)
        for lane in range(LANES):
            x, y = lane % SIDE, lane // SIDE
            line = SIDE * (row - 1) + y
            if line >= picture.shape[0]:
                continue
            find_turns(x, y, side, near_of)
            total[:] = 0
            for asked in near_of:
                _add(weighed, row, x, y, int(asked), total)
            for key in range(len(is_soft)):
                if is_soft[key]:
                    for near in range(LANES):
                        _add_key(keys, row, x, y, near, key, weights, np.float32(1 / LANES), total)
                else:
                    own = -low(y) * SIDE - low(x)
                    _add_key(keys, row, x, y, own, key, weights, np.float32(1), total)
            for at in range(1, 1 + (picture.shape[1] - x + SIDE - 1) // SIDE):
                if is_open[row, at]:
                    for c in range(3):
                        matt = surfaces[row, lane, MATT + c, at]
                        picture[line, SIDE * (at - 1) + x, c] += matt * total[c, at]


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _add(
    weighed: _FLOATS, row: int, x: int, y: int, near: int, total: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Add what one of the 4 × 4 pixels around knows to `total` (3, columns), inside the border."""
    qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
    r, q, right = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3), qx >> 2
    for c in range(3):
        known = weighed[r, q, c]
        for at in range(np.uint64(1), np.uint64(total.shape[1] - 1)):
            total[c, at] += known[np.uint64(np.int64(at) + right)]


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _add_key(
    keys: _FLOATS,
    row: int,
    x: int,
    y: int,
    near: int,
    key: int,
    weights: _FLOATS,
    share: np.float32,
    total: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add a share of what one of the 4 × 4 pixels around sees of a key light."""
    qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
    seen, right = keys[row + (qy >> 2), (qy & 3) * SIDE + (qx & 3), key], qx >> 2
    for c in range(3):
        weight = share * weights[c, key]
        for at in range(np.uint64(1), np.uint64(total.shape[1] - 1)):
            total[c, at] += weight * seen[np.uint64(np.int64(at) + right)]
