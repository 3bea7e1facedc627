"""What neighbouring pixels lend each other of the lobes that they mirror a map by.

The pixels of a square of 4 × 4 share a lobe's rays. Each takes the mean of 5 × 5 around it, the
outer ones half, which has every ray once and moves nothing to a side; of those alone that mirror
about the same part of the map.

Input  : what each pixel's few rays saw.    Output : radiance.
Cost   : about 0.2 µs a pixel.
Fails  : pixels side by side that mirror alike lend each other what they see wherever they lie: the
         outline of what hides the map is wider by two pixels.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.rays.embree import PACKET
from render.rays.row_order import row_order
from render.rays.surface_rows import ALPHA2, F0, F90, GLOSSY, KIND, LANES, SIDE

_FLOATS = NDArray[np.float32]

TOWARD, FACING, GRAZING = 0, 3, 6
LOBE_FIELDS = 9
"""Rows of a lobe: the mirrored direction (3); of the radiance that it sees, what a surface reflects
by F0 (3) and by F90 (3)."""

_REACH = 2
_TENT = np.outer([1, 2, 2, 2, 1], [1, 2, 2, 2, 1]).astype(np.float32)
_LEAST_ALPHA2 = np.float32(1e-10)
_ALIKE = np.float32(2)  # α² over another's, at most
_MOST_TURN2 = np.float32(2)
"""Square of the angle between what pixels mirror, over α², from which they lend each other nothing.

Nearer to it they lend less and less, or what is lent from one side alone would be seen."""


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_shared_lobes(
    surfaces: _FLOATS, lobes: _FLOATS, rough_alpha2: float, picture: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Add to `picture` (H, W, 4) what surfaces of an α² below `rough_alpha2` mirror.

    Parameters
    ----------
    surfaces : (rows, LANES, FIELDS, columns) float32
    lobes : (rows, LANES, LOBE_FIELDS, columns) float32
        What each of those surfaces saw by itself.
    """
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        _add_row(surfaces, lobes, np.float32(rough_alpha2), order[k], picture)


@njit(nogil=True, error_model="numpy")
def _add_row(
    surfaces: _FLOATS, lobes: _FLOATS, rough_alpha2: np.float32, row: int, picture: _FLOATS
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    mean = np.empty((LOBE_FIELDS - FACING, PACKET), np.float32)
    weight, total = np.empty(PACKET, np.float32), np.empty(PACKET, np.float32)
    for lane in range(LANES):
        x, y = lane % SIDE, lane // SIDE
        line = SIDE * (row - 1) + y
        if line >= height:
            continue
        seen, own = surfaces[row, lane], lobes[row, lane]
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            if not _mirrors(seen, first, rough_alpha2):
                continue
            mean[:] = 0
            total[:] = 0
            for dy in range(-_REACH, _REACH + 1):
                for dx in range(-_REACH, _REACH + 1):
                    r, q = row + ((y + dy) >> 2), SIDE * ((y + dy) & 3) + ((x + dx) & 3)
                    at = first + ((x + dx) >> 2)
                    _compare(
                        seen, own, first, surfaces[r, q], lobes[r, q], at, rough_alpha2,
                        _TENT[dy + _REACH, dx + _REACH], weight,
                    )  # fmt: skip
                    _take(lobes[r, q], at, weight, mean, total)
            for i in range(min(PACKET, (width - x + SIDE - 1) // SIDE - first + 1)):
                if seen[KIND, first + i] != GLOSSY or seen[ALPHA2, first + i] >= rough_alpha2:
                    continue
                column, each = SIDE * (first - 1 + i) + x, np.float32(1) / total[i]
                for c in range(3):
                    facing, grazing = mean[c, i], mean[3 + c, i]
                    reflected = seen[F0 + c, first + i] * facing + seen[F90, first + i] * grazing
                    picture[line, column, c] += each * reflected


@njit(nogil=True, error_model="numpy")
def _mirrors(
    seen: _FLOATS, first: int, rough_alpha2: np.float32
) -> bool:  # pragma: no cover - compiled
    """Whether any surface of a packet, (FIELDS, columns), mirrors the map."""
    some, at = False, np.uint64(first)
    for i in range(np.uint64(PACKET)):
        some |= (seen[KIND, at + i] == np.float32(GLOSSY)) & (seen[ALPHA2, at + i] < rough_alpha2)
    return some


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _compare(
    seen: _FLOATS,
    own: _FLOATS,
    first: int,
    others_seen: _FLOATS,
    others: _FLOATS,
    at: int,
    rough_alpha2: np.float32,
    tent: np.float32,
    weight: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `weight` (16,) to `tent` for neighbours that mirror the same, to less for others."""
    here, there = np.uint64(first), np.uint64(at)
    for i in range(np.uint64(PACKET)):
        dx = others[TOWARD, there + i] - own[TOWARD, here + i]
        dy = others[TOWARD + 1, there + i] - own[TOWARD + 1, here + i]
        dz = others[TOWARD + 2, there + i] - own[TOWARD + 2, here + i]
        alpha2, others_alpha2 = seen[ALPHA2, here + i], others_seen[ALPHA2, there + i]
        lends = (
            (others_seen[KIND, there + i] == np.float32(GLOSSY))
            & (others_alpha2 < rough_alpha2)
            & (others_alpha2 <= _ALIKE * alpha2)
            & (alpha2 <= _ALIKE * others_alpha2)
        )
        most2 = _MOST_TURN2 * max(alpha2, _LEAST_ALPHA2)
        part_of_most = (dx * dx + dy * dy + dz * dz) / most2
        weight[i] = tent * np.float32(lends) * max(np.float32(1) - part_of_most, np.float32(0))


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _take(
    others: _FLOATS, at: int, weight: _FLOATS, mean: _FLOATS, total: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Add what neighbours saw, by `weight`, to `mean` (6, 16), and these to `total`."""
    there = np.uint64(at)
    for i in range(np.uint64(PACKET)):
        total[i] += weight[i]
    for c in range(6):
        for i in range(np.uint64(PACKET)):
            mean[c, i] += weight[i] * others[FACING + c, there + i]
