"""Neighbouring pixels on the same surface, and what they lend each other.

Around each pixel lies a square of 4 × 4, one of each lane. Its first column is one or two to the
left of the pixel, in turns, so that on the whole it lies in the middle.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.rays.embree import PACKET
from render.rays.surface_rows import FIELDS, KIND, LANES, NORMAL, NOTHING, POSITION, SIDE

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_LEAST_AGREEMENT = np.float32(0.9)  # of the normals of one surface at neighbouring pixels
_MOST_OFF_PLANE = np.float32(3.0)  # in widths of a pixel there
_MOST_SLOPE2 = np.float32(0.15**2)  # and of the way to the neighbour: surfaces are curved


@njit(nogil=True, error_model="numpy")
def load_packet(
    surfaces: _FLOATS, lane: int, first: int, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Copy the surfaces of a packet's pixels; return whether there is one."""
    some, at = np.float32(0), np.uint64(first)
    for i in range(np.uint64(part.shape[1])):
        some = max(some, surfaces[lane, KIND, at + i])
    if some == NOTHING:
        return False
    for field in range(FIELDS):
        for i in range(np.uint64(part.shape[1])):
            part[field, i] = surfaces[lane, field, at + i]
    return True


@njit(nogil=True, error_model="numpy")
def low(x: int) -> int:  # pragma: no cover - compiled
    """First column of the 4 × 4 pixels around a pixel, from it: −1 and −2 in turns."""
    return -1 - x // 2


@njit(nogil=True, error_model="numpy")
def find_turns(x: int, y: int, side: int, near_of: NDArray[np.int64]) -> None:  # pragma: no cover
    """Set which pixel of the 4 × 4 around has each turn, the nearest if there are several."""
    for turn in range(len(near_of)):
        best = 100
        for near in range(LANES):
            dx, dy = near % SIDE + low(x), near // SIDE + low(y)
            is_turn = (x + dx) % side == turn % side and (y + dy) % side == turn // side
            if is_turn and dx * dx + dy * dy < best:
                best = dx * dx + dy * dy
                near_of[turn] = near


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def compare(
    surfaces: _FLOATS,
    row: int,
    x: int,
    y: int,
    step: int,
    side: int,
    first: int,
    pixel_rad: np.float32,
    eye: _FLOATS,
    part: _FLOATS,
    like: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `like` (side², PACKET) to 1 for neighbours that lie on the same surface as `part`.

    These are a square of pixels `step` apart whose first is (x, y), counted from the tile's first.
    """
    most = (_MOST_OFF_PLANE * pixel_rad) ** 2
    ex, ey, ez = eye[0], eye[1], eye[2]
    for near in range(side * side):
        qx, qy = x + near % side * step, y + near // side * step
        r, q, at = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3), np.uint64(first + (qx >> 2))
        for i in range(np.uint64(part.shape[1])):
            nx, ny, nz = part[NORMAL, i], part[NORMAL + 1, i], part[NORMAL + 2, i]
            px, py, pz = part[POSITION, i], part[POSITION + 1, i], part[POSITION + 2, i]
            agreement = (
                nx * surfaces[r, q, NORMAL, at + i]
                + ny * surfaces[r, q, NORMAL + 1, at + i]
                + nz * surfaces[r, q, NORMAL + 2, at + i]
            )
            dx = surfaces[r, q, POSITION, at + i] - px
            dy = surfaces[r, q, POSITION + 1, at + i] - py
            dz = surfaces[r, q, POSITION + 2, at + i] - pz
            off = nx * dx + ny * dy + nz * dz
            apart = dx * dx + dy * dy + dz * dz
            px, py, pz = px - ex, py - ey, pz - ez
            away = px * px + py * py + pz * pz
            is_like = (
                (agreement > _LEAST_AGREEMENT)
                & (off * off < most * away + _MOST_SLOPE2 * apart)
                & (surfaces[r, q, KIND, at + i] > 0)
            )
            like[near, i] = np.float32(is_like)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def average_keys(
    keys: _FLOATS, row: int, x: int, y: int, first: int, light: int, like: _FLOATS, mean: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set row `light` of `mean` to what a packet sees of it, over the like ones of 4 × 4 around."""
    for i in range(PACKET):
        mean[light, i] = 0
    for near in range(LANES):
        qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
        r, q, at = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3), np.uint64(first + (qx >> 2))
        for i in range(np.uint64(PACKET)):
            mean[light, i] += like[near, i] * keys[r, q, light, at + i]
    for i in range(PACKET):
        count = np.float32(0)
        for near in range(LANES):
            count += like[near, i]
        mean[light, i] /= max(count, np.float32(1))


@njit(nogil=True, error_model="numpy")
def find_places(
    row: int, x: int, y: int, columns: int, near_of: NDArray[np.int64], places: NDArray[np.uint64]
) -> None:  # pragma: no cover - compiled
    """Set where the pixel of each turn lies in (rows, LANES, columns), counted from its tile."""
    for turn in range(len(near_of)):
        near = near_of[turn]
        qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
        lane = (qy & 3) * SIDE + (qx & 3)
        places[turn] = np.uint64(((row + (qy >> 2)) * LANES + lane) * columns + (qx >> 2))


@njit(nogil=True, error_model="numpy")
def borrow(
    shared: NDArray[Any], places: NDArray[np.uint64], at: int, seen: NDArray[Any]
) -> None:  # pragma: no cover - compiled
    """Copy to `seen` (turns, slots) what a pixel of tile `at` and its neighbours saw in turn.

    `shared` is as in `trace_lights`, its first three axes in one.
    """
    tile = np.uint64(at)
    for turn in range(np.uint64(len(places))):
        for slot in range(np.uint64(seen.shape[1])):
            seen[turn, slot] = shared[places[turn] + tile, slot]
