"""Cells of least spread, cut as they were in the last frame wherever that is still nearly as good.

The same cells as methods/cells.py makes, in one compiled loop and with a memory: a cell that was
cut before is cut at the same place unless another is clearly better, and sooner than one that was
not. So noise moves no cut, and what does change changes where the map did.

Domain : world frame; blocks of a lat-long grid (summed_area.py). The seam is an edge of the first
cell.
Cost   : for each light, a look at every row and column of one cell.
Fails  : a cut that is still good enough is not the best one: the spread that is left may be larger,
         by as much as `_HOLDS` and `_STAYS_CUT` allow.
"""

import heapq
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.summed_area import rectangle_lit, rectangle_moments, variance
from lighting.cells.cell_splitting import first_part_end

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

_HOLDS = 1.25
"""A cut stays while the spread it leaves is at most this many times the least one."""
_STAYS_CUT = 1.5
"""A cell that was cut counts as this many times as important as one that was not."""


@dataclass(frozen=True, eq=False)
class CellTree:
    """Cells, each cut into two or a leaf; cell 0 is the whole map.

    Attributes
    ----------
    rectangles : (n, 4) int64
        (top, bottom, left, right) in blocks, half open. Cells 2 k + 1 and 2 k + 2 are the parts of
        the (k + 1)-th cell that was cut, so that the first 2 m − 1 cells hold the tree of m leaves.
    cuts : (n,) int64
        Number of each cell's cut, as `cell_splitting.parts` counts them; −1 for a leaf.
    first_part : (n,) int64
        Index of each cell's first part, the second comes right after it; −1 for a leaf.
    """

    rectangles: Counts
    cuts: Counts
    first_part: Counts

    def leaves(self) -> Counts:
        """Return the indices of the leaves, rising."""
        return np.flatnonzero(self.first_part < 0)

    def prefix(self, count: int) -> "CellTree":
        """Return the tree when it had at most `count` leaves; empty for none."""
        number = max(min(2 * count - 1, len(self.cuts)), 0)
        is_inner = (self.first_part >= 0) & (self.first_part < number)
        return CellTree(
            self.rectangles[:number],
            np.where(is_inner, self.cuts, -1)[:number],
            np.where(is_inner, self.first_part, -1)[:number],
        )


EMPTY_TREE = CellTree(np.empty((0, 4), np.int64), np.empty(0, np.int64), np.empty(0, np.int64))


def grow_tree(
    moments: Array, lit: Counts, count: int, before: CellTree = EMPTY_TREE
) -> tuple[CellTree, Counts]:
    """Return the tree of at most `count` leaves with light, and which cell each one was.

    Parameters
    ----------
    moments : (rows + 1, columns + 1, 4) float64
    lit : (rows + 1, columns + 1) int64
        From `summed_area.summed_area_tables`.
    count : int
        At least 1.
    before : CellTree
        That of the last frame; an empty one, or one of another grid, for none.

    Returns
    -------
    tree : CellTree
        Of one dark leaf if there is no light.
    was : (n,) int64
        Index in `before` of the same cell, −1 for a new one.
    """
    whole = (0, lit.shape[0] - 1, 0, lit.shape[1] - 1)
    if len(before.cuts) and tuple(before.rectangles[0]) != whole:
        before = EMPTY_TREE
    rectangles, cuts, first_part, was = _grow(
        moments, lit, count, before.rectangles, before.cuts, before.first_part
    )
    return CellTree(rectangles, cuts, first_part), was


def tree_sums(blocks: Array, tree: CellTree) -> Array:
    """Return sums (n, channels) over each cell of a tree, of blocks (rows, columns, channels)."""
    return _tree_sums(blocks, tree.rectangles, tree.first_part)


@njit(cache=True, nogil=True)
def _grow(moments, lit, count, old_rectangles, old_cuts, old_parts):  # type: ignore[no-untyped-def]
    rectangles = np.empty((2 * count - 1, 4), np.int64)
    cuts = np.full(2 * count - 1, -1, np.int64)
    first_part = np.full(2 * count - 1, -1, np.int64)
    was = np.full(2 * count - 1, -1, np.int64)
    rectangles[0] = (0, lit.shape[0] - 1, 0, lit.shape[1] - 1)
    if len(old_rectangles):
        was[0] = 0
    queue = [(np.inf, -1)]  # the end of the queue, behind every cell
    new_cells, number = 0, 1
    while True:
        for new in range(new_cells, number):
            top, bottom, left, right = rectangles[new]
            if rectangle_lit(lit, top, bottom, left, right) > 1:
                power, x, y, z = rectangle_moments(moments, top, bottom, left, right)
                importance = power * variance(power, x, y, z)
                if was[new] >= 0 and old_cuts[was[new]] >= 0:
                    importance *= _STAYS_CUT
                heapq.heappush(queue, (-importance, new))
        if queue[0][1] < 0 or number + 2 > len(cuts):
            break
        _, cell = heapq.heappop(queue)
        top, bottom, left, right = rectangles[cell]
        old_cut = old_cuts[was[cell]] if was[cell] >= 0 else -1
        cut = _best_cut(moments, lit, top, bottom, left, right, old_cut)
        cuts[cell] = cut
        first_part[cell] = number
        row, column = first_part_end(cut, top, bottom, left, right)
        rectangles[number] = (top, row, left, column)
        rectangles[number + 1] = (
            (top, bottom, column, right) if column < right else (row, bottom, left, right)
        )
        if cut == old_cut:
            was[number] = old_parts[was[cell]]
            was[number + 1] = was[number] + 1
        new_cells, number = number, number + 2
    return rectangles[:number], cuts[:number], first_part[:number], was[:number]


@njit(cache=True, nogil=True)
def _best_cut(moments, lit, top, bottom, left, right, old_cut):  # type: ignore[no-untyped-def]
    """Return the cut that leaves the least spread, or the old one if it is nearly as good."""
    total = rectangle_moments(moments, top, bottom, left, right)
    total_lit = rectangle_lit(lit, top, bottom, left, right)
    best, least, old = -1, np.inf, np.inf
    for cut in range(right - left + bottom - top - 2):
        row, column = first_part_end(cut, top, bottom, left, right)
        first_lit = rectangle_lit(lit, top, row, left, column)
        if first_lit == 0 or first_lit == total_lit:
            continue
        power, x, y, z = rectangle_moments(moments, top, row, left, column)
        spread = variance(power, x, y, z) + variance(
            total[0] - power, total[1] - x, total[2] - y, total[3] - z
        )
        if spread < least:
            best, least = cut, spread
        if cut == old_cut:
            old = spread
    return old_cut if old <= _HOLDS * least else best


@njit(cache=True, nogil=True)
def _tree_sums(blocks, rectangles, first_part):  # type: ignore[no-untyped-def]
    channels = blocks.shape[2]
    sums = np.zeros((len(rectangles), channels))
    for cell in range(len(rectangles) - 1, -1, -1):  # parts come after what they are parts of
        if first_part[cell] >= 0:
            sums[cell] = sums[first_part[cell]] + sums[first_part[cell] + 1]
            continue
        top, bottom, left, right = rectangles[cell]
        for r in range(top, bottom):
            for c in range(left, right):
                for k in range(channels):
                    sums[cell, k] += blocks[r, c, k]
    return sums
