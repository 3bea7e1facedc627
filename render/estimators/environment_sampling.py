"""Directions drawn by the light of the map, whatever surfaces reflect.

`inverse_cdf` carries evenly spread points to where the light is. `strata` shares out the map among
the lights of one of lighting's reductions, each cell to the nearest, and draws one direction from
each share: what placed those lights well stratifies as well, and without their error.

Fails  : a mirror's lobe is met too rarely; light that a surface turns away from is drawn in vain.

References
----------
.. [1] S. Agarwal, R. Ramamoorthi, S. Belongie, H. W. Jensen, "Structured Importance Sampling of
       Environment Maps", SIGGRAPH, 2003: strata from which one direction each is taken.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lighting.maps.environment import luminance
from lighting.reduce import reduce_to_lights
from lighting.sphere.latlong import cell_directions, solid_angles
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.map_tables import map_tables, place_in_cell
from render.estimators.points import net, random
from render.estimators.proposals import add_proposed
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible,
    add_waiting,
    reflect,
    waiting,
)
from render.rays.embree import PACKET
from render.reference.surfaces import HIT


class Strata(NamedTuple):
    """A map shared out.

    Attributes
    ----------
    cells : (J,) int64
        Flat indices of all cells that have light, those of a stratum one after another.
    starts : (K + 1,) int64
        First of each stratum; none is empty.
    cumulative : (J,) float64
        Share of each stratum's power in its cells up to each; the last of a stratum is 1.
    power : (K,) float64
        ∫ of luminance over each stratum.
    colour : (J, 3) float32
        Radiance over luminance.
    """

    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    cumulative: NDArray[np.float64]
    power: NDArray[np.float64]
    colour: Floats


def inverse_cdf(setting: Setting) -> Estimate:
    """Prepare to draw from the whole map by its luminance."""
    tables = map_tables(setting.environment)

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        return int(
            add_proposed(
                setting.shadows, tables, True, False, surfaces, net(samples), seed, radiance
            )
        )

    return estimate


def strata(method: str, setting: Setting) -> Estimate:
    """Prepare to draw a direction from the cell of each light of a reduction."""

    @cache
    def shared_out(samples: int) -> Strata:
        return share_out(method, setting, samples)

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        parts = shared_out(samples)
        height = setting.environment.height
        return int(_add_strata(setting.shadows, parts, height, surfaces, seed, radiance))

    return estimate


def share_out(method: str, setting: Setting, count: int) -> Strata:
    """Return the map's cells, each with the nearest light of a reduction to `count`."""
    environment = setting.environment
    brightness = luminance(environment.radiance).ravel()
    power = brightness * np.repeat(solid_angles(environment.height), 2 * environment.height)
    cells = np.flatnonzero(power)
    if not len(cells):
        none = np.zeros(0)
        return Strata(cells, np.zeros(1, np.int64), none, none, np.zeros((0, 3), np.float32))
    sites = reduce_to_lights(environment, count, method).directions
    directions = cell_directions(environment.height).reshape(-1, 3)[cells]
    nearest = cKDTree(sites).query(directions)[1]
    cells = cells[np.argsort(nearest, kind="stable")]
    counts = np.bincount(nearest)
    starts = np.concatenate([[0], np.cumsum(counts[counts > 0])])
    powers = np.add.reduceat(power[cells], starts[:-1])
    summed = np.cumsum(power[cells])
    before = np.repeat(summed[starts[:-1]] - power[cells][starts[:-1]], np.diff(starts))
    cumulative = (summed - before) / np.repeat(powers, np.diff(starts))
    cumulative[starts[1:] - 1] = 1.0
    colour = environment.radiance.reshape(-1, 3)[cells] / brightness[cells, None]
    return Strata(cells, starts, cumulative, powers, colour.astype(np.float32))


@njit(cache=True, nogil=True, parallel=True)
def _add_strata(
    shadows: Shadows,
    strata: Strata,
    height: int,
    surfaces: Floats,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        held = waiting()
        light = np.zeros((FIELDS, PACKET), np.float32)
        for s in range(len(strata.power)):
            first, end = strata.starts[s], strata.starts[s + 1]
            for i in range(PACKET):
                share, v = random(seed, k, i, s), random(seed, k, i + PACKET, s)
                at = first + np.searchsorted(strata.cumulative[first:end], share, side="right")
                row, column = divmod(strata.cells[at], 2 * height)
                below = strata.cumulative[at - 1] if at > first else 0.0
                u = (share - below) / (strata.cumulative[at] - below)
                x, y, z = place_in_cell(row, column, height, u, v)
                light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i] = x, y, z
                for c in range(3):
                    light[CARRIED + c, i] = strata.power[s] * strata.colour[at, c]
            reflect(shadows, surface, light)
            traced += add_visible(shadows, surface, light, held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
    return traced
