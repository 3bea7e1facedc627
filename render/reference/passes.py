"""One pass over a picture: an estimate of each pixel, independent of that of any other pass.

Pixels come in tiles of 4 × 4, one packet of rays. A pass sees each pixel through n × n points, one
in each square of its area, and each point has a share of the directions of a pixel
(sampled_light.py): which, is left to chance.

Of a matt surface only what is missing is estimated: its irradiance without shadows is known from
the whole pool (irradiance.py), and a direction in which nothing stands in the way adds nearly
nothing.

Cost   : see tests/benchmarks/reference.py.
Fails  : only light that comes straight from the map or the discs; none by way of other surfaces.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.embree import PACKET, hit_packet, packet
from render.reference.emitters import Emitters
from render.reference.irradiance import CORNERS, Irradiance, set_corners
from render.reference.pixel_rays import SIDE, aim, mixed
from render.reference.sampled_light import Rays, add_from_lobes, add_from_pool
from render.reference.surfaces import F90, FIELDS, HIT, MATT, Tables, find_surfaces

Floats = NDArray[np.float32]


class Sums(NamedTuple):
    """What passes add to.

    Attributes
    ----------
    radiance, squares : (H, W, 4) float64
        Sums over passes of the estimates of a pixel, red, green, blue and what share of it is
        covered, and of their squares.
    rays : (rows of tiles,) int64
        Directions looked at, in which something might have stood.
    """

    radiance: NDArray[np.float64]
    squares: NDArray[np.float64]
    rays: NDArray[np.int64]


@njit(cache=True, nogil=True, parallel=True)
def add_pass(
    functions: tuple[int, int],
    scene: int,
    view: Floats,
    tables: Tables,
    emitters: Emitters,
    pool: Floats,
    smooth: Irradiance,
    spent: Rays,
    seed: int,
    rows: NDArray[np.int64],
    sums: Sums,
) -> None:  # pragma: no cover - compiled
    """Add an estimate of every pixel to `sums`.

    Parameters
    ----------
    functions, scene : (int, int), int
        Addresses of Embree's rtcIntersect16, rtcOccluded16 and scene.
    view : (4, 3) float32
        The eye; the direction toward the picture's upper left corner; what a column and a row add.
    pool : (M, 8) float32
        Of `draw_pool`; M a multiple of the strata.
    smooth : Irradiance
        From the pool.
    seed : int
        Another for every pass.
    rows : (rows of tiles,) int64
        All of them, in an order that gives each thread as much to do.
    """
    for k in prange(len(rows)):
        _add_row(functions, scene, view, tables, emitters, pool, smooth, spent, seed, rows[k], sums)


@njit(nogil=True, fastmath={"contract"})
def _add_row(
    functions: tuple[int, int],
    scene: int,
    view: Floats,
    tables: Tables,
    emitters: Emitters,
    pool: Floats,
    smooth: Irradiance,
    spent: Rays,
    seed: int,
    row: int,
    sums: Sums,
) -> None:  # pragma: no cover - compiled
    height, width = sums.radiance.shape[:2]
    hits, in_picture = hit_packet()
    shadow = packet()
    surface = np.zeros((FIELDS, PACKET), np.float32)
    light = np.zeros((9, PACKET), np.float32)
    corners = np.zeros((CORNERS, PACKET), np.float32)
    total = np.zeros((4, PACKET), np.float32)
    points = spent.side * spent.side
    traced = 0
    for first in range(0, width, SIDE):
        tile = mixed(mixed(np.uint64(seed)) ^ np.uint64(row << 32 | first))
        turn = int(tile % np.uint64(points))
        total[:] = 0
        for point in range(points):
            random = mixed(tile + np.uint64(point + 1))
            some = aim(view, first, SIDE * row, width, height, spent.side, point, random, hits)
            in_picture[:] = some
            find_surfaces(functions[0], scene, tables, hits, in_picture, surface)
            if surface[HIT].max() == 0:
                continue
            total[3] += surface[HIT] / np.float32(points)
            share = (point + turn) % points
            _add_unshadowed(smooth, points, surface, corners, total)
            traced += add_from_pool(
                functions[1], scene, tables.sphere, emitters.lowest, pool, spent, share, random,
                surface, corners, shadow, light, total,
            )  # fmt: skip
            if spent.lobe and (surface[F90] * surface[HIT]).max() > 0:
                traced += add_from_lobes(
                    functions[1], scene, tables.sphere, emitters, spent, share, tile, surface,
                    shadow, light, total,
                )  # fmt: skip
        for i in range(PACKET):
            y, x = SIDE * row + i // SIDE, first + i % SIDE
            if y < height and x < width:
                for c in range(4):
                    value = np.float64(total[c, i])
                    sums.radiance[y, x, c] += value
                    sums.squares[y, x, c] += value * value
    sums.rays[row] += traced


@njit(nogil=True, fastmath={"contract"})
def _add_unshadowed(
    smooth: Irradiance, points: int, surface: Floats, corners: Floats, total: Floats
) -> None:  # pragma: no cover - compiled
    """Add what matt surfaces reflect where nothing stands in the way, and set `corners`."""
    for i in range(PACKET):
        red, green, blue = set_corners(smooth, surface, i, corners)
        share = surface[HIT, i] / np.float32(points)
        total[0, i] += share * surface[MATT, i] * red
        total[1, i] += share * surface[MATT + 1, i] * green
        total[2, i] += share * surface[MATT + 2, i] * blue
