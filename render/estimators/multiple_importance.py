"""Directions drawn by the light and by what surfaces reflect, weighed against each other.

Of a direction of density p₁ by the light and p₂ by the BRDF, of which n₁ and n₂ are drawn, one of
the first kind counts f L / (n₁ p₁) times n₁ p₁ / (n₁ p₁ + n₂ p₂), the balance heuristic, or times
(n₁ p₁)² / ((n₁ p₁)² + (n₂ p₂)²), the power heuristic [1]_.

A single direction is of the first kind by chance, and n₁ that chance: the one-sample model [3]_. Of
more, as many as are due are of each kind, which errs less.

With compensation [2]_ the light is drawn only by what of it is above the map's mean, for the BRDF
draws the rest well enough.

References
----------
.. [1] E. Veach, L. Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering",
       SIGGRAPH, 1995.
.. [2] O. Karlík, M. Šik, P. Vévoda, T. Skřivan, J. Křivánek, "MIS Compensation: Optimizing
       Sampling Techniques in Multiple Importance Sampling", SIGGRAPH Asia, 2019.
.. [3] E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", PhD thesis, Stanford
       University, 1997.
"""

import math

import numpy as np
from numba import njit, prange

from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.lobes import mirror_shares, reflected_density
from render.estimators.map_tables import MapTables, map_tables
from render.estimators.points import Points, net, random, shifted, shifts_of
from render.estimators.proposals import draw, set_carried
from render.estimators.shading import (
    FIELDS,
    TOWARD,
    add_visible,
    add_waiting,
    reflect,
    waiting,
)
from render.rays.embree import PACKET
from render.reference.surfaces import HIT

BALANCE, POWER = 1, 2

_GOLDEN = 0.6180339887498949


def multiple_importance(
    setting: Setting,
    *,
    heuristic: int = BALANCE,
    light_share: float = 0.5,
    is_compensated: bool = False,
) -> Estimate:
    """Prepare to draw a share of the directions by the light, the others by the BRDF.

    Parameters
    ----------
    heuristic : int
        `BALANCE` or `POWER`: the exponent of n p.
    light_share : float
        Of the directions, in [0, 1]; `allocation` makes their numbers of it.
    """
    tables = map_tables(setting.environment, is_compensated=is_compensated)
    if not tables.density.any():
        light_share = 0.0

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        by_light = allocation(samples, light_share)
        return int(
            _add(
                setting.shadows,
                tables,
                heuristic,
                surfaces,
                by_light,
                samples,
                net(math.ceil(by_light)),
                net(samples - int(by_light)),
                seed,
                radiance,
            )
        )

    return estimate


def allocation(samples: int, light_share: float) -> float:
    """Return how many of `samples` directions the light draws.

    Whole, and each way draws one at least if it has a share; of a single direction, its chance.
    """
    if samples == 1 or light_share in (0.0, 1.0):
        return samples * light_share
    return float(min(max(round(samples * light_share), 1), samples - 1))


@njit(nogil=True, error_model="numpy", forceinline=True)
def weight(mine: float, other: float, heuristic: int) -> float:  # pragma: no cover - compiled
    """Return the weight of a direction; `mine` is n p of the way it was drawn, positive."""
    if heuristic == BALANCE:
        return mine / (mine + other)
    return 1 / (1 + (other / mine) ** 2)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add(
    shadows: Shadows,
    tables: MapTables,
    heuristic: int,
    surfaces: Floats,
    light_samples: float,
    samples: int,
    of_light: Points,
    of_brdf: Points,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    brdf_samples = samples - light_samples
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        held = waiting()
        light = np.zeros((FIELDS, PACKET), np.float32)
        shifts = shifts_of(seed, k, 0), shifts_of(seed, k, PACKET)
        shares = mirror_shares(surface)
        turn = random(seed, k, 2 * PACKET, 0)
        for s in range(samples):
            for i in range(PACKET):
                if surface[HIT, i] == 0:
                    continue
                # Where chance decides, it does so evenly over neighbours.
                by_light = s + (turn + _GOLDEN * i) % 1.0 < light_samples
                if by_light:
                    u, v = shifted(of_light, s, shifts[0][i])
                else:
                    u, v = shifted(of_brdf, s - int(light_samples), shifts[1][i])
                row, column, density = draw(tables, by_light, shares[i], surface, u, v, light, i)
                if by_light:
                    x, y, z = light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i]
                    mine = light_samples * density
                    other = brdf_samples * reflected_density(surface, i, shares[i], x, y, z)
                else:
                    mine = brdf_samples * density
                    other = light_samples * tables.density[row, column]
                scale = weight(mine, other, heuristic) / mine if mine > 0 else 0.0
                set_carried(tables, row, column, scale, light, i)
            reflect(shadows, surface, light)
            traced += add_visible(shadows, surface, light, held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
    return traced
