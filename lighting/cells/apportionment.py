"""Lights shared out among nested regions by weight.

Domain : regions with weights, each within its parent (nested_regions.py).
Input  : weights, most lights of each, parents, a number of lights.    Output : owners and seats.
Cost   : n log n in the number of regions, and in that of lights.
Fails  : a region is given up or not by comparison with a threshold; see
         tests/limits/test_structured_noise.py.

References
----------
.. [1] A. Sainte-Laguë, "La représentation proportionnelle et la méthode des moindres carrés",
       Annales scientifiques de l'École normale supérieure 27, 1910.
"""

from heapq import heapify, heappop, heappush

import numpy as np
from numba import njit
from numpy.typing import NDArray


def apportion(
    weight: NDArray[np.float64],
    most: NDArray[np.int64],
    parents: NDArray[np.int64],
    count: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the region that has each region's lights, and the number of lights of each.

    Parameters
    ----------
    weight : (n,) float64
        At least 0; positive where `most` is.
    most : (n,) int64
        Lights that each region can hold.
    parents : (n,) int64
        Greater than the region, but for the last, which is the root.
    count : int
        Lights to share out, at least 1.

    Returns
    -------
    owners : (n,) int64
        The region itself, or the region around it that it was given up to.
    seats : (n,) int64
        `count` in all, or Σ `most` if that is smaller; at least 1 for every owner that can hold
        one, at most what it and those given up to it can hold.

    Notes
    -----
    The faintest region is given up to the one around it, weight and all, as long as its share of
    the lights rounds to none or there are more regions than lights. Those left get a light each;
    each light more goes to the region of largest weight/(lights + ½) [1]_, so that with more lights
    no region ever has fewer, unless the regions themselves change.
    """
    scale = _lights_per_weight(weight, most, count)
    weight, most = weight.copy(), most.copy()
    owners = _give_up_faint(weight, most, parents, count, 0.5 / scale)
    return owners, _seats(weight, most, min(count, int(most.sum())))


def _lights_per_weight(weight: NDArray[np.float64], most: NDArray[np.int64], count: int) -> float:
    """Return s such that Σ min(s · weight, most) is `count`; infinite if Σ most is no more."""
    below = most > 0
    left = count
    while below.any():
        scale = left / float(weight[below].sum())
        full = below & (scale * weight >= most)
        if not full.any():
            return scale
        left -= int(most[full].sum())
        below &= ~full
    return np.inf


@njit(cache=True, nogil=True)
def _give_up_faint(weight, most, parents, count, least):  # type: ignore[no-untyped-def]
    """Merge regions into those around them, in place; return the owners."""
    root = len(parents) - 1
    owners = np.arange(root + 1)
    alive = (most > 0).sum()
    queue = [(weight[region], region) for region in range(root)]
    heapify(queue)
    while queue:
        lightest, region = heappop(queue)
        if owners[region] != region or weight[region] != lightest:
            continue  # given up, or heavier since it was queued
        if lightest >= least and alive <= count:
            break
        around = _owner(owners, parents[region])
        alive -= most[around] > 0 and most[region] > 0
        owners[region] = around
        weight[around] += lightest
        most[around] += most[region]
        most[region] = 0
        if around != root:
            heappush(queue, (weight[around], around))
    for region in range(root):
        owners[region] = _owner(owners, region)
    return owners


@njit(cache=True, nogil=True)
def _owner(owners, region):  # type: ignore[no-untyped-def]
    while owners[region] != region:
        region = owners[region]
    return region


@njit(cache=True, nogil=True)
def _seats(weight, most, count):  # type: ignore[no-untyped-def]
    seats = (most > 0).astype(np.int64)
    queue = [(-weight[i] / 1.5, i) for i in range(len(most)) if most[i] > 1]
    heapify(queue)
    for _ in range(count - seats.sum()):
        _, region = heappop(queue)
        seats[region] += 1
        if seats[region] < most[region]:
            heappush(queue, (-weight[region] / (seats[region] + 0.5), region))
    return seats
