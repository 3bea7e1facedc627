"""Regions of a lat-long picture between brightness thresholds, each within a darker one.

At each threshold, what is at least that bright falls into connected components. A region is what of
a component is not also above the next threshold; its parent is the region that surrounds it, below
the threshold. What is below all thresholds is one region, the root, connected or not.

Domain : lat-long grid of any size. Its left and right edge touch, and at either pole so do all
         entries of the row.    Input : a picture.    Output : labels and parents.
Cost   : one pass for each threshold, and one union for each pair of neighbours above it.
Fails  : a component is connected or it is not: one entry more decides
         (tests/limits/test_structured_noise.py).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def nested_regions(
    brightness: NDArray[np.float64], thresholds: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the region of each entry, and each region's parent.

    Parameters
    ----------
    brightness : (rows, columns) float64
    thresholds : (k,) float64
        Ascending; equal ones make no region between them.

    Returns
    -------
    regions : (rows, columns) int64
        From 0. Entries that share a side are neighbours.
    parents : (n,) int64
        Regions greater than their children; the last is the root, its own parent. Every region but
        the root has entries.
    """
    levels = np.searchsorted(thresholds, brightness, side="right")
    return _label(levels, len(thresholds))


@njit(cache=True, nogil=True)
def _label(levels, top_level):  # type: ignore[no-untyped-def]
    rows, columns = levels.shape
    regions = np.empty((rows, columns), np.int64)
    link = np.arange(rows * columns)  # a forest of entries: a tree is a component
    newest = np.full(rows * columns, -1)  # the last region of the component of a tree's root
    parents = np.full(rows * columns + 1, -1)
    members = np.empty(rows * columns, np.int64)  # an entry of each region
    count = 0
    for level in range(top_level, 0, -1):
        _join_neighbours(levels, level, link)
        first = count
        for entry in range(rows * columns):
            if levels.flat[entry] != level:
                continue
            tree = _root(link, entry)
            if newest[tree] < first:
                newest[tree] = count
                members[count] = entry
                count += 1
            regions.flat[entry] = newest[tree]
        for region in range(first):
            if parents[region] < 0:
                surrounding = newest[_root(link, members[region])]
                if surrounding >= first:
                    parents[region] = surrounding
    for entry in range(rows * columns):
        if levels.flat[entry] == 0:
            regions.flat[entry] = count
    parents = parents[: count + 1]
    parents[parents < 0] = count
    return regions, parents


@njit(cache=True, nogil=True)
def _join_neighbours(levels, least, link):  # type: ignore[no-untyped-def]
    """Join the trees of neighbours of at least some level."""
    rows, columns = levels.shape
    for row in range(rows):
        previous = -1  # in a row at a pole
        for column in range(columns):
            if levels[row, column] < least:
                continue
            entry = row * columns + column
            if levels[row, column - 1] >= least:
                _join(link, entry, row * columns + (column - 1) % columns)
            if row > 0 and levels[row - 1, column] >= least:
                _join(link, entry, entry - columns)
            if row in (0, rows - 1):
                if previous >= 0:
                    _join(link, entry, previous)
                previous = entry


@njit(cache=True, nogil=True)
def _root(link, entry):  # type: ignore[no-untyped-def]
    while link[entry] != entry:
        link[entry] = link[link[entry]]
        entry = link[entry]
    return entry


@njit(cache=True, nogil=True)
def _join(link, first, second):  # type: ignore[no-untyped-def]
    first, second = _root(link, first), _root(link, second)
    link[max(first, second)] = min(first, second)
