"""Directions drawn from the product of the map with what sixteen neighbours reflect, for all alike.

The surfaces of a packet are neighbours in the picture, and mostly want the same light. So the
product of the light in runs of the map (light_runs.py) with what surfaces reflect of it is made for
all of them at once: of the root of the sum of their squared responses, which makes the sum of their
variances least. Even shares of that are strata, each direction is drawn once and looked at by all,
which costs a sixteenth, and rays that run side by side are traced several times as fast. A pixel's
error stays what it would be alone; only neighbours err together.

Fails  : pictures of few samples are blotched by squares of 4 × 4 pixels; where neighbours differ,
         as at outlines, directions suit none of them well; lobes much narrower than a run are met
         too rarely.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.estimators.block_response import respond
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.light_runs import LightRuns, draw_from_run, light_runs
from render.estimators.points import random
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible_alike,
    reflect,
    start_at,
)
from render.rays.embree import PACKET, packet
from render.reference.surfaces import HIT

Array = NDArray[np.float64]


def shared_product(setting: Setting) -> Estimate:
    """Prepare to draw from the product for sixteen surfaces at once."""
    runs = light_runs(setting.environment)

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        return int(_add(setting.shadows, runs, surfaces, samples, seed, radiance))

    return estimate


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add(
    shadows: Shadows,
    runs: LightRuns,
    surfaces: Floats,
    samples: int,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    count = len(runs.power)
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        shadow = packet()
        start_at(surface, shadow)
        light = np.zeros((FIELDS, PACKET), np.float32)
        share = np.zeros(count)
        if _set_shares(runs, surface, share) == 0:
            continue
        run, upto = -1, 0.0
        start = random(seed, k, 0, 0)  # one for all: even steps err a fifth less than jitter
        for s in range(samples):
            target = (s + start) / samples
            while run < 0 or (target >= upto and run < count - 1):
                run += 1
                upto += share[run]
            if share[run] == 0:
                continue
            within = min(max((target - upto) / share[run] + 1, 0.0), 1 - 2.0**-53)
            at, x, y, z = draw_from_run(runs, run, within, random(seed, k, 1, s))
            scale = 1 / (share[run] * runs.density[at] * samples)
            row, column = divmod(runs.cells[at], 2 * runs.radiance.shape[0])
            light[TOWARD], light[TOWARD + 1], light[TOWARD + 2] = x, y, z
            for c in range(3):
                light[CARRIED + c] = scale * runs.radiance[row, column, c]
            reflect(shadows, surface, light)
            traced += add_visible_alike(shadows, surface, light, shadow, radiance[k])
    return traced


@njit(nogil=True, error_model="numpy")
def _set_shares(runs: LightRuns, surface: Floats, share: Array) -> float:  # pragma: no cover
    """Set how much of the directions each run gets, and return the sum before it was made 1."""
    each = np.zeros(PACKET, np.float32)
    whole = 0.0
    for b in range(len(runs.power)):
        x, y, z = runs.directions[b]
        respond(surface, x, y, z, np.float32(runs.radius_rad), each)
        squares = np.float32(0)
        for i in range(PACKET):
            squares += each[i] * each[i]
        share[b] = math.sqrt(squares) * runs.power[b]
        whole += share[b]
    if whole > 0:
        share /= whole
    return whole
