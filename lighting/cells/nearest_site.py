"""Cells of points around sites on the sphere: each point belongs to the site nearest to it.

Domain : unit vectors.    Input : points in tiles of neighbours, sites.    Output : site of each.
Cost   : each tile is compared with all sites, each of its points with the few that can be nearest
         to a point of the tile: 8 ms for 131072 points and 256 sites on a busy core.
Fails  : with more sites than points in a tile, the first comparison is most of the time.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TiledPoints:
    """Points, those of a tile one after another, with a cap around each tile.

    Attributes
    ----------
    points : (n, 3) float64
        Unit vectors.
    starts : (m + 1,) int64
        First point of each tile; no tile is empty.
    centres : (m, 3) float64
        Unit vectors.
    radii_rad : (m,) float64
        No point of a tile is farther from its centre.
    """

    points: Array
    starts: NDArray[np.int64]
    centres: Array
    radii_rad: Array


def tiled(points: Array, tiles: NDArray[np.int64]) -> TiledPoints:
    """Return points (n, 3) whose `tiles` (n,) ascend, with what culls them."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(tiles) != 0, [True]]))
    centres = np.add.reduceat(points, starts[:-1])
    # Where a tile goes around a pole evenly any centre will do.
    centres += 1e-9 * points[starts[:-1]]
    centres /= np.linalg.norm(centres, axis=1)[:, None]
    cosines = np.einsum("ij,ij->i", points, np.repeat(centres, np.diff(starts), axis=0))
    least = np.minimum.reduceat(cosines, starts[:-1])
    return TiledPoints(points, starts, centres, np.arccos(np.clip(least, -1, 1)))


def nearest_sites(tiled_points: TiledPoints, sites: Array) -> NDArray[np.int64]:
    """Return the site (n,) nearest to each point, of sites (k, 3); the first of equally near."""
    return _nearest(
        tiled_points.points, tiled_points.starts, tiled_points.centres, tiled_points.radii_rad,
        np.ascontiguousarray(sites),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _nearest(points, starts, centres, radii_rad, sites):  # type: ignore[no-untyped-def]
    nearest = np.empty(len(points), np.int64)
    cosines = np.empty(len(sites))
    near = np.empty(len(sites), np.int64)
    for tile in range(len(centres)):
        x, y, z = centres[tile]
        most = -1.0
        for k in range(len(sites)):
            cosines[k] = x * sites[k, 0] + y * sites[k, 1] + z * sites[k, 2]
            most = max(most, cosines[k])
        # A site farther than the centre's nearest by a diameter is nearest to no point of the tile.
        limit_rad = np.arccos(min(most, 1.0)) + 2 * radii_rad[tile] + 1e-7
        limit = np.cos(limit_rad) if limit_rad < np.pi else -2.0
        number = 0
        for k in range(len(sites)):
            if cosines[k] >= limit:
                near[number] = k
                number += 1
        for i in range(starts[tile], starts[tile + 1]):
            x, y, z = points[i]
            best = -2.0
            for j in range(number):
                k = near[j]
                cosine = x * sites[k, 0] + y * sites[k, 1] + z * sites[k, 2]
                if cosine > best:
                    best = cosine
                    nearest[i] = k
    return nearest
