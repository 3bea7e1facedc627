"""Evenly spread points of the unit square, moved at random for each surface.

The (0, 2)-sequence with a random digital shift: each point by itself is even in the square,
whatever their number, and all of them still spread evenly.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.sampling.low_discrepancy import low_discrepancy_points
from render.rays.embree import PACKET
from render.reference.pixel_rays import mixed

Points = NDArray[np.uint32]
PointSet = Callable[[int], Points]

_BITS = 2.0**32


@cache
def net(count: int) -> Points:
    """Return the first `count` points of the sequence, (count, 2), as 32 bits each."""
    points = (low_discrepancy_points(count) * _BITS).astype(np.uint32)
    points.setflags(write=False)
    return points


@cache
def hammersley(count: int) -> Points:
    """Return the points (s / count, radical inverse of s), (count, 2), as 32 bits each."""
    index = np.arange(count)
    inverse = np.zeros(count, np.uint64)
    for bit in range(32):
        inverse |= ((index >> bit) & 1).astype(np.uint64) << np.uint64(31 - bit)
    points = np.stack([(index / count * _BITS).astype(np.uint32), inverse.astype(np.uint32)], -1)
    points.setflags(write=False)
    return points


def independent(count: int) -> Points:
    """Return points for which `shift_of` is to be another for each: independent random ones."""
    return np.zeros((count, 2), np.uint32)


@njit(nogil=True, forceinline=True)
def shift_of(seed: int, k: int, i: int) -> np.uint64:  # pragma: no cover - compiled
    """Return the shift of place `i` of packet `k`, below 2³² both: 64 random bits."""
    return mixed(mixed(np.uint64(seed)) ^ np.uint64(k << 32 | i))


@njit(nogil=True, forceinline=True)
def shifts_of(seed: int, k: int, first: int) -> NDArray[np.uint64]:  # pragma: no cover - compiled
    """Return `shift_of` surfaces `first` to `first` + 15 of packet `k`, (16,)."""
    shifts = np.empty(PACKET, np.uint64)
    for i in range(PACKET):
        shifts[i] = shift_of(seed, k, first + i)
    return shifts


@njit(nogil=True, forceinline=True)
def shifted(points: Points, s: int, shift: np.uint64) -> tuple[float, float]:  # pragma: no cover
    """Return point `s`, moved, in [0, 1)²."""
    u = np.uint64(points[s, 0]) ^ (shift >> np.uint64(32))
    v = np.uint64(points[s, 1]) ^ (shift & np.uint64(0xFFFFFFFF))
    return np.float64(u) * (1 / _BITS), np.float64(v) * (1 / _BITS)


@njit(nogil=True, forceinline=True)
def random(seed: int, k: int, i: int, s: int) -> float:  # pragma: no cover - compiled
    """Return a random number in [0, 1) for sample `s` of surface `i` of packet `k`."""
    bits = mixed(shift_of(seed, k, i) + np.uint64(s + 1))
    return np.float64(bits >> np.uint64(11)) * (1 / 2.0**53)
