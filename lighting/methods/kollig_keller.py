"""Voronoi cells of lights on the sphere, relaxed: by Lloyd's rule, and by Kollig and Keller's.

A light stands for all that is nearer to it than to any other. Lloyd's relaxation moves each light
to the centroid of what it stands for, finds anew what that is, and so on, which makes the total
variance smaller at every step. It stays near where it starts, so cells of a start blind to light
end with very unequal powers. Kollig and Keller [1]_ grow the lights instead: cells of the largest
power get a second light, and all are relaxed, again and again.

Domain : world frame, lat-long grid (CONVENTIONS.md). Unseen cells count as what they hold.
Input  : EnvironmentMap, or sums over blocks (summed_area.py).
Output : directions, irradiance and angular radius of each light.
Cost   : one pass over the map; for each step of relaxation, one over its blocks (nearest_site.py).
Fails  : Lloyd's lights have large unequal powers; noise and motion send either's lights another way
         and to other numbers (tests/limits/test_lloyd_powers.py, test_kollig_keller_noise.py).

References
----------
.. [1] T. Kollig, A. Keller, "Efficient Illumination by High Dynamic Range Images", Eurographics
       Symposium on Rendering, 2003.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.block_grid import coarsened
from lighting.blocks.summed_area import block_sums, label_sums
from lighting.cells.cell_splitting import lights_of_sums
from lighting.cells.farthest_points import farthest_point_strata
from lighting.cells.nearest_site import TiledPoints, nearest_sites, tiled
from lighting.maps.environment import EnvironmentMap

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

_LLOYD_STEPS = 20
_STEPS_PER_ROUND = 2
_FINAL_STEPS = 4
_GROWTH = 1.25
"""Of the number of lights in a round."""
_FIRST = 4
"""Lights to begin with."""
_COARSE_ROWS = 64
"""Rows of the blocks on which the first half of the lights grow."""
_TILE = 8
"""Blocks along a side of a tile."""


def lloyd(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
    """Return `count` lights that Lloyd's relaxation moves from a start that is blind to light.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, at least 1. Fewer are returned if they hold all the light: one for each
        block of the map (summed_area.py) that has any.

    Returns
    -------
    directions : (n, 3) float64
        Unit vectors in the world frame, toward the light.
    irradiance : (n, 3) float64
        Radiance × sr. They sum to the map's integral.
    angular_radius_rad : (n,) float64
        Radius of the disc that is spread as the light is.

    Notes
    -----
    The start is the farthest-point strata (farthest_points.py) of the blocks with light.
    """
    return lloyd_of_blocks(block_sums(environment.radiance), count)


def lloyd_of_blocks(blocks: Array, count: int) -> tuple[Array, Array, Array]:
    """Return what `lloyd` does, from sums over blocks (rows, columns, 7)."""
    if not blocks[..., 0].any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    sums, points, tiles = _lit_blocks(blocks)
    labels = _spread_labels(points, tiles, min(count, len(sums)))
    labels = _relaxed(sums, points, labels, _LLOYD_STEPS)
    return lights_of_sums(label_sums(sums, labels, labels.max() + 1))


def kollig_keller(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
    """Return `count` lights grown from a few by parting the cells of largest power.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        As for `lloyd`.

    Returns
    -------
    directions, irradiance, angular_radius_rad : (n, 3), (n, 3), (n,) float64
        As from `lloyd`.

    Notes
    -----
    The paper [1]_ adds a light, relaxes, and so on. Here a round parts the cells of largest power,
    a quarter as many as there are, and relaxes by two steps: the number of rounds goes with the
    logarithm of `count`. A cell's second light stands at the block that adds most to its variance.
    The first half of the lights grow on coarser blocks, which is three to four times as fast and,
    on six captured maps, no worse.
    """
    return kollig_keller_of_blocks(block_sums(environment.radiance), count)


def kollig_keller_of_blocks(blocks: Array, count: int) -> tuple[Array, Array, Array]:
    """Return what `kollig_keller` does, from sums over blocks (rows, columns, 7)."""
    if not blocks[..., 0].any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    sites = np.empty((0, 3))
    for rows, share in ((_COARSE_ROWS, 0.5), (len(blocks), 1.0)):
        sums, points, tiles = _lit_blocks(coarsened(blocks, rows))
        wanted = min(max(int(share * count), 1), len(sums))
        labels = _grown(sums, points, tiles, sites, wanted)
        cells = label_sums(sums, labels, wanted)
        sites = _centroids(cells)
    return lights_of_sums(cells)


def _grown(sums: Array, points: TiledPoints, tiles: Labels, sites: Array, wanted: int) -> Labels:
    """Return the cell of each point (n,), of `wanted` cells grown from those around `sites`."""
    number = len(sites) or min(_FIRST, wanted)
    grown_before = len(sites) > 0
    labels = _around(sums, points, sites) if grown_before else _spread_labels(points, tiles, number)
    while True:
        steps = _STEPS_PER_ROUND if number < wanted else _FINAL_STEPS
        labels = _relaxed(sums, points, labels, steps)
        if number == wanted:
            return labels
        larger = min(max(int(number * _GROWTH), number + 1), wanted)
        number = _part(sums, points.points, labels, label_sums(sums, labels, number), larger)


def _lit_blocks(blocks: Array) -> tuple[Array, TiledPoints, Labels]:
    """Return sums (n, 7), centroids and tiles (n,) of the blocks with light, tile by tile."""
    rows, columns = np.nonzero(blocks[..., 0])
    tiles = rows // _TILE * blocks.shape[1] + columns // _TILE
    order = np.argsort(tiles, kind="stable")
    sums, tiles = blocks[rows[order], columns[order]], tiles[order]
    moments = sums[:, 1:4]
    return sums, tiled(moments / np.linalg.norm(moments, axis=1)[:, None], tiles), tiles


def _spread_labels(points: TiledPoints, tiles: Labels, count: int) -> Labels:
    """Return `count` farthest-point strata (n,) of the points."""
    one_region = np.zeros(len(tiles), np.int64)
    return farthest_point_strata(points.points, one_region, tiles, np.array([count]))


def _relaxed(sums: Array, points: TiledPoints, labels: Labels, steps: int) -> Labels:
    """Return the cell of each point (n,) after steps of Lloyd's relaxation; none goes empty."""
    number = int(labels.max()) + 1
    for _ in range(steps):
        moved = _around(sums, points, _centroids(label_sums(sums, labels, number)))
        if np.array_equal(moved, labels):
            break
        labels = moved
    return labels


def _around(sums: Array, points: TiledPoints, sites: Array) -> Labels:
    """Return the cell of each point (n,) around sites (k, 3), none of them empty."""
    labels = nearest_sites(points, sites)
    _fill_empty(sums, points.points, labels, label_sums(sums, labels, len(sites)))
    return labels


def _centroids(cells: Array) -> Array:
    """Return unit vectors (k, 3) toward the centroids of sums (k, 7)."""
    moments = cells[:, 1:4]
    length = np.linalg.norm(moments, axis=1)[:, None]
    # Light that comes evenly from all sides has no centroid; any place serves as well.
    return np.divide(
        moments, length, out=np.tile([0.0, 1.0, 0.0], (len(cells), 1)), where=length > 0
    )


@njit(cache=True, nogil=True)
def _part(sums, points, labels, cells, wanted):  # type: ignore[no-untyped-def]
    """Give cells of largest power a second one until `wanted` or each has; return how many."""
    number = len(cells)
    size = np.bincount(labels, minlength=number)
    farthest = np.full(number, -1)
    most = np.full(number, -np.inf)
    for i in range(len(labels)):
        share = _share_of_variance(sums[i], points[i], cells[labels[i]])
        if share > most[labels[i]]:
            most[labels[i]] = share
            farthest[labels[i]] = i
    for cell in np.argsort(-cells[:, 0], kind="mergesort"):
        if number == wanted:
            break
        if size[cell] > 1:
            labels[farthest[cell]] = number
            number += 1
    return number


@njit(cache=True, nogil=True)
def _fill_empty(sums, points, labels, cells):  # type: ignore[no-untyped-def]
    """Give each empty cell the block that adds most to the variance of one that has others."""
    size = np.bincount(labels, minlength=len(cells))
    for empty in np.flatnonzero(size == 0):
        most = -np.inf
        farthest = -1
        for i in range(len(labels)):
            if size[labels[i]] > 1:
                share = _share_of_variance(sums[i], points[i], cells[labels[i]])
                if share > most:
                    most, farthest = share, i
        size[labels[farthest]] -= 1
        size[empty] = 1
        labels[farthest] = empty


@njit(cache=True, nogil=True)
def _share_of_variance(block, point, cell):  # type: ignore[no-untyped-def]
    """Return a block's luminous power × its squared distance from the cell's mean direction."""
    x, y, z = (
        point[0] - cell[1] / cell[0],
        point[1] - cell[2] / cell[0],
        point[2] - cell[3] / cell[0],
    )
    return block[0] * (x * x + y * y + z * z)
