"""Irradiance interpolated between few places where it is measured well; peaks of light drawn.

What of the map is far above its mean is taken out and drawn directly, as sources are in [1]_: few
rays of a record would meet it, and its shadows are sharp. Of the rest, matt surfaces get what
records hold: where none of irradiance_records.py fits a surface, one is measured there. Records are
kept for all later passes of the picture, and with what it has so far when it is interrupted.
Mirrors see the rest by their lobe.

Fails  : passes do not tell the error of records, which stays as it is: shadows of the rest are
         smoothed (tests/limits/test_irradiance_records.py). A dielectric's matt part of the rest is
         dimmed by Fresnel's share toward the eye.

References
----------
.. [1] P. Debevec, "Image-Based Lighting", IEEE Computer Graphics and Applications 22(2), 2002: with
       Ward's RADIANCE, which caches irradiance so.
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap, luminance
from render.estimators.brdf_sampling import brdf
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.irradiance_records import (
    FIELDS,
    PLACE,
    RADIUS,
    Array,
    add_irradiance,
    fit,
    measure,
)
from render.estimators.map_tables import MapTables, map_tables
from render.estimators.multiple_importance import multiple_importance
from render.rays.embree import PACKET, intersect16_address
from render.reference.surfaces import F0, F90, HIT, MATT, NORMAL, ORIGIN, TO_EYE

ERROR = 0.2
"""Ward's `a`: records are used where their estimated error is below this."""

PEAK = 2.0
"""What light is drawn directly, in means of the map's luminance."""

_STRATA_PER_SAMPLE = 64
_FIRST_CAPACITY = 1024
_GOLDEN = 0.6180339887498949


def irradiance_cache(setting: Setting) -> Estimate:
    """Prepare to fill a cache; a record takes 64 times as many rays as there are samples."""
    peaks, rest = split(setting.environment)
    tables = map_tables(rest)
    mirrors = brdf(setting._replace(environment=rest))
    sources = multiple_importance(setting._replace(environment=peaks))

    memory = {} if setting.memory is None else setting.memory

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        known = memory.get(samples, np.zeros((0, FIELDS)))
        rings = max(round(math.sqrt(_STRATA_PER_SAMPLE * samples / math.pi)), 2)
        records = memory[samples] = filled(setting.shadows, tables, rings, surfaces, seed, known)
        _interpolate(records, surfaces, radiance)
        traced = (len(records) - len(known)) * rings * round(math.pi * rings)
        if surfaces[:, F90].any():
            mirroring = surfaces.copy()
            mirroring[:, MATT : MATT + 3] = 0
            mirroring[:, HIT] *= mirroring[:, F90] > 0
            traced += mirrors(mirroring, samples, seed, radiance)
        if peaks.radiance.any():
            traced += sources(surfaces, samples, seed + 1, radiance)
        return traced

    return estimate


def split(environment: EnvironmentMap) -> tuple[EnvironmentMap, EnvironmentMap]:
    """Return what of a map is above `PEAK` times its mean luminance, and the rest."""
    bound = PEAK * float(environment.integral() @ LUMINANCE_WEIGHTS) / (4 * math.pi)
    brightness = luminance(environment.radiance)
    share = np.minimum(bound / np.maximum(brightness, np.finfo(np.float32).tiny), 1.0)
    rest = (environment.radiance * share[..., None]).astype(np.float32)
    return (
        replace(environment, radiance=environment.radiance - rest),
        replace(environment, radiance=rest),
    )


def filled(
    shadows: Shadows, tables: MapTables, rings: int, surfaces: Floats, seed: int, records: Array
) -> Array:
    """Return records with those added that surfaces lack, one after another."""
    order = np.argsort(np.arange(len(surfaces)) * _GOLDEN % 1)
    first = 0
    while first < len(order):
        room = np.zeros((max(2 * len(records), _FIRST_CAPACITY), FIELDS))
        room[: len(records)] = records
        first, count = _fill(
            intersect16_address(), shadows, tables, rings, surfaces, order[first:], seed, room,
            len(records), first,
        )  # fmt: skip
        records = room[:count]
    return records


@njit(cache=True, nogil=True)
def _fill(
    function: int,
    shadows: Shadows,
    tables: MapTables,
    rings: int,
    surfaces: Floats,
    order: NDArray[np.int64],
    seed: int,
    records: Array,
    count: int,
    done: int,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Add records until there is no more room; return how many packets are done, and records."""
    near = np.empty(len(records), np.int64)
    for k in order:
        surface = surfaces[k]
        number = _gather(records, count, surface, near)
        for i in range(PACKET):
            if surface[HIT, i] == 0:
                continue
            is_known = False
            for n in range(number):
                is_known |= fit(records[near[n]], surface, i) > 1 / ERROR
            if is_known:
                continue
            if count == len(records):
                return done, count
            measure(
                function, shadows.scene, shadows.lowest, tables, rings,
                shadows.sphere, surface, i, seed + k, records[count],
            )  # fmt: skip
            near[number] = count
            number, count = number + 1, count + 1
        done += 1
    return done, count


@njit(cache=True, nogil=True, parallel=True)
def _interpolate(records: Array, surfaces: Floats, radiance: Floats) -> None:  # pragma: no cover
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        near = np.empty(len(records), np.int64)
        number = _gather(records, len(records), surface, near)
        irradiance = np.zeros(3)
        for i in range(PACKET):
            if surface[HIT, i] == 0:
                continue
            irradiance[:] = 0
            whole = 0.0
            for n in range(number):
                weight = fit(records[near[n]], surface, i)
                if weight > 1 / ERROR:
                    whole += weight
                    add_irradiance(records[near[n]], weight, surface, i, irradiance)
            n_v = 0.0
            for axis in range(3):
                n_v += surface[NORMAL + axis, i] * surface[TO_EYE + axis, i]
            grazing = (1 - min(n_v, 1.0)) ** 5
            for c in range(3):
                fresnel = surface[F0 + c, i] + (surface[F90, i] - surface[F0 + c, i]) * grazing
                matt = (1 - fresnel) * surface[MATT + c, i]
                radiance[k, c, i] += matt * irradiance[c] / whole


@njit(nogil=True)
def _gather(
    records: Array, count: int, surface: Floats, near: NDArray[np.int64]
) -> int:  # pragma: no cover - compiled
    """Set `near` to the records that may fit any surface of a packet; return their number."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(PACKET):
        if surface[HIT, i] > 0:
            for axis in range(3):
                low[axis] = min(low[axis], surface[ORIGIN + axis, i])
                high[axis] = max(high[axis], surface[ORIGIN + axis, i])
    number = 0
    for r in range(count):
        apart2 = 0.0
        for axis in range(3):
            place = records[r, PLACE + axis]
            step = max(low[axis] - place, place - high[axis], 0.0)
            apart2 += step * step
        if apart2 <= (ERROR * records[r, RADIUS]) ** 2:
            near[number] = r
            number += 1
    return number
