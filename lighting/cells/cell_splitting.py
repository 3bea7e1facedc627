"""Lights that stand for the cells of a map that is cut in two again and again.

A cell is a rectangle of the lat-long grid, the first one the whole map. The cell that matters most
is cut in two until there are as many as lights are wanted; a method says which matters most, and
where to cut it. Both parts of a cut have light. A light has all the light of its cell, stands at
its centroid, and is as wide as its cell's light is spread.

Domain : world frame. The seam is an edge of the first cell, whatever the map shows there.
Input  : sums over blocks and a method's two functions.    Output : lights.
Fails  : a source on the seam takes two lights (tests/limits/test_cells_seam.py); sources within one
         block are one light (tests/limits/test_cells_blocks.py).
"""

import heapq
from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.summed_area import (
    cell_sums,
    rectangle_lit,
    rectangle_moments,
    summed_area_tables,
    variance,
)

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Cell = tuple[int, int, int, int]
"""Rows [top, bottom) and columns [left, right) of blocks, as (top, bottom, left, right)."""

ChooseCut = Callable[[Array, Counts, Cell], int]
"""From the tables of `summed_area_tables` and a cell to the number of a cut, see `parts`."""
Priority = Callable[[float, float, float, float], float]
"""From ∫Y dω and the three of ∫Y d dω of a cell to how much it matters to cut it."""

_BALANCED = 1e-9
"""Mean resultant length below which the light of a cell comes from everywhere alike."""


def lights_of_cells(
    blocks: Array, count: int, choose_cut: ChooseCut, priority: Priority
) -> tuple[Array, Array, Array]:
    """Return one light for each of at most `count` cells that hold all the light of a map.

    Parameters
    ----------
    blocks : (rows, columns, 7) float64
        Sums over the blocks of the map, as from `summed_area.block_sums`.
    count : int
        Number of lights, at least 1.
    choose_cut, priority : callable
        The method.

    Returns
    -------
    directions : (n, 3) float64
        Unit vectors toward the centroids of the cells' luminance. +Y where that is the centre of
        the sphere.
    irradiance : (n, 3) float64
        ∫L dω of each cell; together, of all blocks.
    angular_radius_rad : (n,) float64
        Of the uniform disc whose mean direction is as long as the cell's, R = (1 + cos a)/2. At
        most π/2, beyond which no surface sees all of it.

    Notes
    -----
    n is `count`, or the number of blocks with light if that is smaller. With one light more, one
    light is replaced and one is added at the end; all others stay.
    """
    moments, lit = summed_area_tables(blocks)
    if lit[-1, -1] == 0:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    cells = _split(moments, lit, count, choose_cut, priority)
    return lights_of_sums(cell_sums(blocks, np.array(cells)))


def parts(cell: Cell, cut: int) -> tuple[Cell, Cell]:
    """Return the two parts of a cell.

    A cell of h × w blocks has w − 1 cuts between columns, numbered from the left from 0, and then
    h − 1 between rows, from the top.
    """
    top, bottom, left, right = cell
    row, column = first_part_end(cut, *cell)
    if column < right:
        return (top, bottom, left, column), (top, bottom, column, right)
    return (top, row, left, right), (row, bottom, left, right)


@njit(cache=True, nogil=True)
def first_part_end(cut, top, bottom, left, right):  # type: ignore[no-untyped-def]
    """Return the bottom and right end of a cell's first part, see `parts`."""
    column_cuts = right - left - 1
    if cut < column_cuts:
        return bottom, left + 1 + cut
    return top + 1 + cut - column_cuts, right


def cut_variances(moments: Array, lit: Counts, cell: Cell) -> Array:
    """Return the variances (cuts, 2) of the two parts that each cut of a cell would make.

    In luminance × sr, as `summed_area.variance`. Infinite where a part would be dark.
    """
    return _cut_variances(moments, lit, *cell)


def _split(
    moments: Array, lit: Counts, count: int, choose_cut: ChooseCut, priority: Priority
) -> list[Cell]:
    """Return the cells, at most `count`."""
    whole = (0, lit.shape[0] - 1, 0, lit.shape[1] - 1)
    cells: list[Cell] = []
    queue: list[tuple[float, int]] = []  # of cells that can be cut, by index

    def place(index: int, cell: Cell) -> None:
        cells[index : index + 1] = [cell]
        if rectangle_lit(lit, *cell) > 1:
            importance = priority(*rectangle_moments(moments, *cell))
            heapq.heappush(queue, (-importance, index))

    place(0, whole)
    while queue and len(cells) < count:
        _, index = heapq.heappop(queue)
        first, second = parts(cells[index], choose_cut(moments, lit, cells[index]))
        place(index, first)
        place(len(cells), second)
    return cells


def lights_of_sums(sums: Array) -> tuple[Array, Array, Array]:
    """Return directions, irradiance and angular radii of sums (n, 7) over cells."""
    power, centroid, irradiance = sums[:, 0], sums[:, 1:4], sums[:, 4:]
    length = np.linalg.norm(centroid, axis=1)
    resultant = length / power
    directions = np.tile([0.0, 1.0, 0.0], (len(sums), 1))
    directed = resultant > _BALANCED
    directions[directed] = centroid[directed] / length[directed, None]
    return directions, irradiance, np.arccos(np.clip(2 * resultant - 1, 0.0, 1.0))


@njit(cache=True, nogil=True)
def _cut_variances(moments, lit, top, bottom, left, right):  # type: ignore[no-untyped-def]
    total = rectangle_moments(moments, top, bottom, left, right)
    total_lit = rectangle_lit(lit, top, bottom, left, right)
    variances = np.empty((right - left + bottom - top - 2, 2))
    for cut in range(len(variances)):
        end_row, end_column = first_part_end(cut, top, bottom, left, right)
        first_lit = rectangle_lit(lit, top, end_row, left, end_column)
        if first_lit == 0 or first_lit == total_lit:
            variances[cut] = np.inf
            continue
        power, x, y, z = rectangle_moments(moments, top, end_row, left, end_column)
        variances[cut, 0] = variance(power, x, y, z)
        variances[cut, 1] = variance(total[0] - power, total[1] - x, total[2] - y, total[3] - z)
    return variances
