"""What rays to wide lights saw, averaged over tiles: one ray to a wide disc tells little.

Only every second tile has sent rays, as the white squares of a chess board. It and its four
diagonal neighbours make one mean, and the four beside a black one another.

Cost   : about 30 ns a pixel and 64 lights.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.moving.neighbours import compare, load_packet
from render.moving.shadow_rays import LOOSE, UNKNOWN, turn_of
from render.rays.embree import PACKET
from render.rays.row_order import row_order
from render.rays.surface_rows import FIELDS, LANES, SIDE

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FLAGS = NDArray[np.bool_]
_WEIGHTS = np.array([1, 2, 1, 2, 4, 2, 1, 2, 1], np.float32)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def soften(
    surfaces: _FLOATS,
    is_open: _FLAGS,
    shared: _BYTES,
    eye: _FLOATS,
    pixel_rad: float,
    side: int,
    turns: int,
    softened: _BYTES,
) -> None:  # pragma: no cover - compiled
    """Fill `softened` with means of `shared` over like pixels of a lane; UNKNOWN without any.

    Lanes are left out whose turn is none of so many.
    """
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        _soften_row(
            surfaces, is_open, shared, eye, np.float32(pixel_rad), side, turns, order[k], softened
        )


@njit(nogil=True, error_model="numpy")
def _soften_row(
    surfaces: _FLOATS,
    is_open: _FLAGS,
    shared: _BYTES,
    eye: _FLOATS,
    pixel_rad: np.float32,
    side: int,
    turns: int,
    row: int,
    softened: _BYTES,
) -> None:  # pragma: no cover - compiled
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((9, PACKET), np.float32)
    slots = shared.shape[3]
    total = np.empty(slots, np.float32)
    is_own = np.empty(PACKET * slots, np.bool_)
    for k in range(PACKET * slots):
        is_own[k] = (row + 1 + k // slots) % 2 == 0
    for lane in range(LANES):
        if turn_of(lane, side) >= turns:
            continue
        x, y = lane % SIDE - SIDE, lane // SIDE - SIDE
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            open_there = is_open[row, first : first + PACKET]
            if open_there.any():
                _average_on_ground(
                    shared[row - 1, lane].ravel(), shared[row, lane].ravel(),
                    shared[row + 1, lane].ravel(), first * slots, slots, is_own,
                    softened[row, lane].ravel(),
                )  # fmt: skip
            if not open_there.all() and load_packet(surfaces[row], lane, first, part):
                compare(surfaces, row, x, y, SIDE, 3, first, pixel_rad, eye, part, like)
                _average(shared, row, lane, first, open_there, like, total, softened)


@njit(nogil=True, error_model="numpy")
def _average_on_ground(
    above: _BYTES,
    middle: _BYTES,
    below: _BYTES,
    first: int,
    slots: int,
    is_own: _FLAGS,
    softened: _BYTES,
) -> None:  # pragma: no cover - compiled
    """Set a packet of `softened` to the weighted means of tiles; all are one lane in a row."""
    for k in range(np.uint64(len(is_own))):
        at = np.uint64(first) + k
        left, right = at - np.uint64(slots), at + np.uint64(slots)
        beside = np.uint16(above[at]) + below[at] + middle[left] + middle[right]
        across = np.uint16(above[left]) + above[right] + below[left] + below[right]
        softened[at] = np.uint8((across + 4 * middle[at]) >> 3 if is_own[k] else beside >> 2)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _average(
    shared: _BYTES,
    row: int,
    lane: int,
    first: int,
    open_there: _FLAGS,
    like: _FLOATS,
    total: _FLOATS,
    softened: _BYTES,
) -> None:  # pragma: no cover - compiled
    """Set a packet of `softened`, where it is not open, to the mean of tiles that are `like`."""
    slots = np.uint64(shared.shape[3])
    for i in range(PACKET):
        if open_there[i]:
            continue
        total[:] = 0
        count, at = np.float32(0), first + i
        for near in range((row + at) % 2, 9, 2):
            weight = _WEIGHTS[near] * like[near, i]
            r, column = row + near // 3 - 1, at + near % 3 - 1
            count += weight
            for slot in range(slots):
                total[slot] += weight * np.float32(shared[r, lane, column, slot])
        for slot in range(slots):
            mean = total[slot] / count + np.float32(0.5)
            softened[row, lane, at, slot] = np.uint8(mean) if count > 0 else UNKNOWN
