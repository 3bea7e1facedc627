"""What rays to wide lights saw, averaged over tiles: one ray to a wide disc tells little.

Only every second tile has sent rays, as the white squares of a chess board. It and its four
diagonal neighbours make one mean, and the four beside a black one another.

Cost   : about 20 ns a pixel and 64 lights, most of it to compare surfaces.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.moving.neighbours import compare, load_packet
from render.moving.shadow_rays import ALL_PASSES, UNKNOWN, turn_of
from render.rays.embree import PACKET
from render.rays.row_order import row_order
from render.rays.surface_rows import FIELDS, LANES, SIDE

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FLAGS = NDArray[np.bool_]
_PAIRS = NDArray[np.uint16]

# Of the tile and those around it.
_WEIGHTS = np.array([1, 2, 1, 2, 4, 2, 1, 2, 1], np.uint16)

# Two slots at once, a byte of a pair each. They are ALL_PASSES, 15 · 16, or 0: counted in
# sixteenths, sums by weights up to 8 stay in bytes, and their means stay in pairs.
_BOTH = 0x0101
_SIXTEENTHS = np.uint16(ALL_PASSES // 16 * _BOTH)
_LOW, _HIGH = np.uint16(0x00FF), np.uint16(0xFF00)
_HALF, _UNKNOWN_PAIR = np.uint16(0x0080), np.uint16(UNKNOWN * _BOTH)
_FOUR, _EIGHT, _FULL = np.uint16(4), np.uint16(8), np.float32(16 * 256)


def soften(
    surfaces: _FLOATS,
    is_open: _FLAGS,
    shared: _BYTES,
    eye: _FLOATS,
    pixel_rad: float,
    side: int,
    turns: int,
    softened: _BYTES,
) -> None:
    """Fill `softened` with means of `shared` over like pixels of a lane; UNKNOWN without any.

    Lanes are left out whose turn is none of so many, and rows of a lane that show nothing. Slots
    come in pairs.
    """
    _soften(
        surfaces, is_open, shared.view(np.uint16), eye, pixel_rad, side, turns,
        softened.view(np.uint16),
    )  # fmt: skip


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _soften(
    surfaces: _FLOATS,
    is_open: _FLAGS,
    shared: _PAIRS,
    eye: _FLOATS,
    pixel_rad: float,
    side: int,
    turns: int,
    softened: _PAIRS,
) -> None:  # pragma: no cover - compiled
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        _soften_row(
            surfaces, is_open, shared, eye, np.float32(pixel_rad), side, turns, order[k], softened
        )


@njit(nogil=True, error_model="numpy")
def _soften_row(
    surfaces: _FLOATS,
    is_open: _FLAGS,
    shared: _PAIRS,
    eye: _FLOATS,
    pixel_rad: np.float32,
    side: int,
    turns: int,
    row: int,
    softened: _PAIRS,
) -> None:  # pragma: no cover - compiled
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((9, PACKET), np.float32)
    columns, per_pixel = shared.shape[2], shared.shape[3]
    near_bits = np.empty(columns, np.uint16)
    chosen = np.empty((columns - 2) * per_pixel, np.uint16)
    total, count = np.empty_like(chosen), np.empty_like(chosen)
    pairs, means = shared.reshape(-1), softened.reshape(-1)
    for lane in range(LANES):
        if turn_of(lane, side) >= turns:
            continue
        x, y, some = lane % SIDE - SIDE, lane // SIDE - SIDE, False
        near_bits[:] = 0
        for first in range(1, columns - 1, PACKET):
            open_there = is_open[row, first : first + PACKET]
            if open_there.all():
                like[:] = 1
            elif load_packet(surfaces[row], lane, first, part):
                compare(surfaces, row, x, y, SIDE, 3, first, pixel_rad, eye, part, like)
            else:
                continue
            _choose(like, open_there, row, first, near_bits)
            some = True
        if some:
            for column in range(1, columns - 1):
                at = np.uint64((column - 1) * per_pixel)
                for k in range(np.uint64(per_pixel)):
                    chosen[at + k] = near_bits[column]
            at = ((row * LANES + lane) * columns + 1) * per_pixel
            _average(pairs, at, LANES * columns * per_pixel, per_pixel, chosen, total, count, means)


@njit(nogil=True, error_model="numpy")
def _choose(
    like: _FLOATS, open_there: _FLAGS, row: int, first: int, near_bits: _PAIRS
) -> None:  # pragma: no cover - compiled
    """Set, a bit for each, which tiles a packet's pixels take the mean of."""
    at = np.uint64(first)
    pixels = np.uint64(like.shape[1])  # no constant: short loops are unrolled and left scalar
    for near in range(9):
        parity, bit = (row + first + near) & 1, np.uint16(1 << near)
        for i in range(pixels):
            is_like = (like[near, i] > 0) | open_there[i]
            counts = is_like & ((np.int64(i) & 1) == parity)
            near_bits[at + i] |= bit if counts else np.uint16(0)


@njit(nogil=True, error_model="numpy")
def _average(
    pairs: _PAIRS,
    at: int,
    per_row: int,
    per_pixel: int,
    chosen: _PAIRS,
    total: _PAIRS,
    count: _PAIRS,
    means: _PAIRS,
) -> None:  # pragma: no cover - compiled
    """Set a row of `means`, from `at` on, to those of the tiles chosen for each."""
    number = np.uint64(len(total))
    for k in range(number):
        total[k] = count[k] = 0
    for near in range(9):
        tile = np.uint64(at + (near // 3 - 1) * per_row + (near % 3 - 1) * per_pixel)
        bit, weight = np.uint16(1 << near), _WEIGHTS[near]
        for k in range(number):
            mine = weight if chosen[k] & bit else np.uint16(0)
            sixteenths = np.uint16(np.uint16(pairs[tile + k] >> _FOUR) & _SIXTEENTHS)
            total[k] += np.uint16(sixteenths * mine)
            count[k] += mine
    to = np.uint64(at)
    for k in range(number):
        scale = np.uint16(_FULL / np.float32(count[k]) + np.float32(0.5))
        low = np.uint16(np.uint16(total[k] & _LOW) * scale)
        high = np.uint16(np.uint16(total[k] >> _EIGHT) * scale)
        mean = np.uint16(low + _HALF) >> _EIGHT | (np.uint16(high + _HALF) & _HIGH)
        means[to + k] = np.uint16(mean) if count[k] else _UNKNOWN_PAIR
