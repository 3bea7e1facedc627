"""Strata of points on the sphere, each around the point that was farthest from all before.

Domain : unit vectors, in regions that share nothing.    Input : positions, regions, seats.
Output : the stratum of each point.
Cost   : about n log k for n points and k strata, where trying all takes n k: points are kept in
         buckets of neighbours, and a bucket that a new centre cannot come nearer to is passed over.
Fails  : strata are up to twice as wide as the best that many could be [1]_.

References
----------
.. [1] T. F. Gonzalez, "Clustering to Minimize the Maximum Intercluster Distance", Theoretical
       Computer Science 38, 1985. Structured importance sampling names Hochbaum and Shmoys for it,
       who in the same year reach the same bound by another way.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def farthest_point_strata(
    positions: NDArray[np.float64],
    regions: NDArray[np.int64],
    buckets: NDArray[np.int64],
    seats: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return the stratum of each point, (n,), from 0: those of the first region first.

    The first centre of a region is its first point; which one that is changes the error of lights
    by 5 % either way. Each further one is the point farthest from all centres so far, and takes
    over the points that it is nearest to.

    Parameters
    ----------
    positions : (n, 3) float64
        Unit vectors, no two alike in a region.
    regions : (n,) int64
        Region of each point, from 0.
    buckets : (n,) int64
        Of points near each other, from 0. Any partition gives the same strata, but for points as
        near to two centres; a good one gives them sooner.
    seats : (m,) int64
        Strata of each region, at least 1 and at most its number of points.
    """
    order = _sorted_by(regions, _sorted_by(buckets, np.arange(len(regions))))
    key = np.stack([regions[order], buckets[order]])
    starts = np.flatnonzero(np.concatenate([[True], (np.diff(key) != 0).any(axis=0), [True]]))
    region_of_bucket = key[0, starts[:-1]]
    region_starts = np.searchsorted(region_of_bucket, np.arange(len(seats) + 1))
    strata = np.empty(len(order), np.int64)
    strata[order] = _grow(positions[order], starts, region_starts, seats)
    return strata


@njit(cache=True, nogil=True)
def _sorted_by(keys, order):  # type: ignore[no-untyped-def]
    """Return `order` sorted stably by small keys; np.argsort takes several times as long."""
    ends = np.zeros(keys.max() + 2, np.int64)
    for key in keys:
        ends[key + 1] += 1
    ends = np.cumsum(ends)
    by_key = np.empty_like(order)
    for i in order:
        by_key[ends[keys[i]]] = i
        ends[keys[i]] += 1
    return by_key


@njit(cache=True, nogil=True)
def _grow(positions, starts, region_starts, seats):  # type: ignore[no-untyped-def]
    """Return strata of points that stand by region, and within it by bucket."""
    middle, radius = _bounds(positions, starts)
    strata = np.zeros(len(positions), np.int64)
    square = np.full(len(positions), np.inf)  # of the distance to the nearest centre so far
    farthest = starts[:-1].copy()  # point of each bucket
    largest = np.full(len(farthest), np.inf)  # square of that point's distance
    reach = np.full(len(farthest), np.inf)  # square of how near a centre must come to matter
    stratum = 0
    for region in range(len(seats)):
        first, last = region_starts[region], region_starts[region + 1]
        for _ in range(seats[region]):
            centre = positions[farthest[first + np.argmax(largest[first:last])]]
            for bucket in range(first, last):
                if _square(centre, middle[bucket]) >= reach[bucket]:
                    continue
                far = starts[bucket]
                for i in range(starts[bucket], starts[bucket + 1]):
                    nearer = _square(centre, positions[i])
                    if nearer < square[i]:
                        square[i] = nearer
                        strata[i] = stratum
                    if square[i] > square[far]:
                        far = i
                farthest[bucket], largest[bucket] = far, square[far]
                reach[bucket] = (np.sqrt(square[far]) + radius[bucket]) ** 2
            stratum += 1
    return strata


@njit(cache=True, nogil=True)
def _bounds(positions, starts):  # type: ignore[no-untyped-def]
    """Return middle (b, 3) and radius (b,) of a ball around each bucket's points."""
    middle = np.zeros((len(starts) - 1, 3))
    radius = np.zeros(len(middle))
    for bucket in range(len(middle)):
        start, end = starts[bucket], starts[bucket + 1]
        for i in range(start, end):
            middle[bucket] += positions[i]
        middle[bucket] /= end - start
        for i in range(start, end):
            radius[bucket] = max(radius[bucket], _square(positions[i], middle[bucket]))
        radius[bucket] = np.sqrt(radius[bucket])
    return middle, radius


@njit(cache=True, nogil=True)
def _square(a, b):  # type: ignore[no-untyped-def]
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z
