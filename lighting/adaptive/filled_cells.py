"""Lights over a fill: what stands for a map when a smooth fill lies under it.

A fill of a given shape (smooth_fill.py) is fitted under the map, what it leaves is cut into a tree
of cells (cell_tree.py), and each cell has a light at the exact centroid of its light and as wide as
its spread. The error that they are predicted to make (prediction.py) comes with them, so that
shapes and numbers can be compared.

Domain : world frame; blocks of a lat-long grid (summed_area.py, block_grid.py).
Cost   : about 0.4 ms for 64 lights on 64 rows; errors of every number of lights, 60 ns more for
         each cell and probe.
Fails  : where the fill is brighter than a whole cell, that cell has no light, and the rest of the
         fill has to be dimmed for it.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.adaptive import prediction
from lighting.adaptive.cell_tree import CellTree, grow_tree, tree_sums
from lighting.adaptive.smooth_fill import FillShape, fit_fill, less_fill
from lighting.blocks.block_grid import BlockGrid
from lighting.blocks.summed_area import summed_area_tables
from lighting.sphere import harmonics

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

_PLAIN = 1e-3
"""A cell of which the fill leaves less than this part has its light at the centroid of the part
that is above the fill: that of what is left may be anywhere."""
_BALANCED = 1e-9


@dataclass(frozen=True, eq=False)
class FilledMap:
    """A map to be lit, as the probes see it.

    Attributes
    ----------
    blocks : (rows, columns, 7) float64
    grid : BlockGrid
        Of these blocks.
    received : (P, 3) float64
        What the probes receive from the blocks.
    scale : float
        Root mean square of what they receive from all light, key lights included.
    integral : (3,) float64
        ∫L dω of the blocks.
    """

    blocks: Array
    grid: BlockGrid
    received: Array
    scale: float
    integral: Array


@dataclass(frozen=True, eq=False)
class FilledCells:
    """A fill, and a light for each cell of a tree over it.

    Attributes
    ----------
    shape : FillShape
    fill : (9, 3) float64
        Before it pays for the cells that it is brighter than.
    tree : CellTree
    was : (n,) int64
        As from `cell_tree.grow_tree`.
    directions, irradiance : (n, 3) float64
    angular_radius_rad : (n,) float64
    numbers : (m,) int64
        Numbers of lights that errors were asked of, rising.
    errors : (m,) float64
        The error predicted for each.
    """

    shape: FillShape
    fill: Array
    tree: CellTree
    was: Counts
    directions: Array
    irradiance: Array
    angular_radius_rad: Array
    numbers: Counts
    errors: Array


def fill_and_cut(
    filled: FilledMap, shape: FillShape, count: int, before: CellTree, *, is_every_number: bool
) -> FilledCells:
    """Return the lights of a map over a fill of one shape.

    Parameters
    ----------
    filled : FilledMap
    shape : FillShape
    count : int
        Number of lights, at most.
    before : CellTree
        Of the last frame, over a fill of the same shape; an empty one for none.
    is_every_number : bool
        Whether the errors of 0 to `count` lights are asked, or of `count` alone.
    """
    fill = fit_fill(filled.blocks, filled.grid, shape)
    left, positive = less_fill(filled.blocks, filled.grid, fill)
    tree, was = grow_tree(*summed_area_tables(positive), max(count, 1), before)
    sums = tree_sums(left, tree)
    directions, irradiance, radius = lights_of_what_is_left(sums, tree_sums(positive, tree))

    integral = harmonics.integral(fill)
    divisor = np.where(integral > 0, integral, np.inf)
    shortage = (irradiance - sums[:, 4:]) / divisor
    probes = len(filled.received)
    from_fill = prediction.fill_responses(fill, filled.grid, probes)
    without = from_fill * (filled.integral / divisor)
    error_without = float(np.sqrt(np.mean((filled.received - without) ** 2))) / filled.scale
    if count == 0:
        numbers, errors = np.array([0]), np.array([error_without])
    elif is_every_number:
        with_lights = prediction.errors_by_count(
            tree.first_part,
            irradiance,
            prediction.responses(directions, radius, probes),
            filled.received,
            from_fill,
            shortage,
            filled.scale,
        )
        errors = np.append(error_without, with_lights)
        numbers = np.arange(len(errors))
    else:
        leaves = tree.leaves()
        error = prediction.error_of(
            irradiance[leaves],
            prediction.responses(directions[leaves], radius[leaves], probes),
            filled.received,
            from_fill,
            shortage[leaves],
            filled.scale,
        )
        numbers, errors = np.array([len(leaves)]), np.array([error])
    return FilledCells(shape, fill, tree, was, directions, irradiance, radius, numbers, errors)


@njit(cache=True, nogil=True)
def lights_of_what_is_left(sums, positive):  # type: ignore[no-untyped-def]
    """Return directions (n, 3), irradiance (n, 3) and angular radii (n,) of cells.

    Of a cell that the fill leaves more than a trace of, the light stands at the exact centroid, so
    that a surface that sees all of the cell receives exactly its light; otherwise at the centroid
    of the part that is above the fill.

    Parameters
    ----------
    sums : (n, 7) float64
        What the fill leaves of each cell, below 0 where it is brighter.
    positive : (n, 4) float64
        ∫Y dω and ∫Y d dω of the part above the fill.
    """
    directions = np.zeros((len(sums), 3))
    irradiance = np.maximum(sums[:, 4:], 0.0)
    radius = np.empty(len(sums))
    for i in range(len(sums)):
        power = sums[i, 0]
        x, y, z = sums[i, 1], sums[i, 2], sums[i, 3]
        length = np.sqrt(x * x + y * y + z * z)
        if power <= _PLAIN * positive[i, 0] or length > power:
            power = positive[i, 0]
            x, y, z = positive[i, 1], positive[i, 2], positive[i, 3]
            length = np.sqrt(x * x + y * y + z * z)
        if length > _BALANCED * power:
            directions[i, 0], directions[i, 1], directions[i, 2] = (
                x / length,
                y / length,
                z / length,
            )
        else:
            directions[i, 1] = 1.0
        resultant = length / power if power > 0 else 1.0
        radius[i] = np.arccos(min(max(2 * resultant - 1, 0.0), 1.0))
    return directions, irradiance, radius
