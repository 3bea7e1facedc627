"""Neighbouring pixels on the same surface, and what they lend each other.

Around each pixel lies a square of 4 × 4, one of each lane. Its first column is one or two to the
left of the pixel, in turns, so that on the whole it lies in the middle.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.moving.shadow_rays import LOOSE
from render.rays.embree import PACKET
from render.rays.first_hits import FIELDS, GROUND, KIND, LANES, NORMAL, NOTHING, POSITION, SIDE

_FLOATS = NDArray[np.float32]
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
    for turn in range(side * side):
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
    if _is_all_ground(surfaces, row, x, y, step, side, first, part):
        like[:] = 1
        return
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


@njit(nogil=True, error_model="numpy")
def _is_all_ground(
    surfaces: _FLOATS, row: int, x: int, y: int, step: int, side: int, first: int, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Whether a packet's pixels show the ground, and so do all neighbours that `compare` asks."""
    for i in range(np.uint64(part.shape[1])):
        if part[KIND, i] != GROUND:
            return False
    others = 0
    for near in range(side * side):
        qx, qy = x + near % side * step, y + near // side * step
        r, q, at = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3), np.uint64(first + (qx >> 2))
        for i in range(np.uint64(part.shape[1])):
            others += surfaces[r, q, KIND, at + i] != GROUND
    return others == 0


@njit(nogil=True, error_model="numpy")
def average_visible(
    visible: _FLOATS, row: int, x: int, y: int, column: int, slot: int, like: _FLOATS, i: int
) -> np.float32:  # pragma: no cover - compiled
    """Return the mean visibility of a slot over the like ones of the 4 × 4 pixels around."""
    total = count = np.float32(0)
    for near in range(LANES):
        qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
        share = like[near, i]
        lane = (qy & 3) * SIDE + (qx & 3)
        total += share * visible[row + (qy >> 2), lane, column + (qx >> 2), slot]
        count += share
    return total / max(count, np.float32(1))


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def soften(
    surfaces: _FLOATS,
    visible: _FLOATS,
    key_count: int,
    eye: _FLOATS,
    pixel_rad: float,
    softened: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Fill `softened` with `visible`, that of soft lights averaged over like pixels of a lane.

    One ray to a wide disc tells little: nine tiles' rays go to nine of its points.
    """
    for row in prange(1, surfaces.shape[0] - 1):
        _soften_row(surfaces, visible, key_count, eye, np.float32(pixel_rad), row, softened)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _soften_row(
    surfaces: _FLOATS,
    visible: _FLOATS,
    key_count: int,
    eye: _FLOATS,
    pixel_rad: np.float32,
    row: int,
    softened: _FLOATS,
) -> None:  # pragma: no cover - compiled
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((9, PACKET), np.float32)
    sums = np.empty((PACKET, visible.shape[3]), np.float32)
    count = np.empty(PACKET, np.float32)
    slots = np.uint64(visible.shape[3])
    for lane in range(LANES):
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            if not load_packet(surfaces[row], lane, first, part):
                continue
            count[:] = 0
            sums[:] = 0
            compare(
                surfaces, row, lane % SIDE - SIDE, lane // SIDE - SIDE, SIDE, 3, first, pixel_rad,
                eye, part, like,
            )  # fmt: skip
            for near in range(9):
                down, right = near // 3 - 1, near % 3 - 1
                weight = np.float32((2 - abs(down)) * (2 - abs(right)))
                beside = visible[row + down, lane, first + right : first + right + PACKET]
                for i in range(PACKET):
                    count[i] += weight * like[near, i]
                if slots - np.uint64(key_count) < np.uint64(4):  # along whichever is longer
                    for slot in range(np.uint64(key_count), slots):
                        for i in range(PACKET):
                            sums[i, slot] += weight * like[near, i] * beside[i, slot]
                    continue
                for i in range(PACKET):
                    w = weight * like[near, i]
                    for slot in range(slots):
                        sums[i, slot] += w * beside[i, slot]
            for i in range(PACKET):
                scale = np.float32(1) / max(count[i], np.float32(1))
                for slot in range(np.uint64(key_count)):
                    softened[row, lane, first + i, slot] = visible[row, lane, first + i, slot]
                for slot in range(np.uint64(key_count), slots):
                    softened[row, lane, first + i, slot] = scale * sums[i, slot]
