"""The lights of one of lighting's reductions, the same for every surface: no noise, but an error.

What lighting and the streaming renderer do, on the terms of the other estimators: all surfaces of a
packet look in the same direction. A fill is a dome of lights (lights/dome.py).

Fails  : shadows are hard, and mirrors show spots. Passes do not tell the error: it is the same in
         all of them, and falls with the number of lights only.
"""

from functools import cache

import numpy as np
from numba import njit, prange

from lighting.reduce import reduce_to_lights
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible_alike,
    reflect,
    start_at,
)
from render.lights.dome import dome_lights
from render.rays.embree import PACKET, packet
from render.reference.surfaces import HIT


def fixed_lights(method: str, setting: Setting) -> Estimate:
    """Prepare to look at as many lights as samples are asked for, by a reduction of lighting."""

    @cache
    def lights_of(samples: int) -> tuple[Floats, Floats]:
        lights = reduce_to_lights(setting.environment, samples, method)
        directions, irradiance = lights.directions, lights.irradiance
        if lights.fill.any():
            dome = dome_lights(lights.fill, upper_only=setting.shadows.lowest >= 0)
            directions = np.concatenate([directions, dome[0]])
            irradiance = np.concatenate([irradiance, dome[1]])
        return directions.astype(np.float32), irradiance.astype(np.float32)

    def estimate(surfaces: Floats, samples: int, _seed: int, radiance: Floats) -> int:
        return int(_add(setting.shadows, *lights_of(samples), surfaces, radiance))

    return estimate


@njit(cache=True, nogil=True, parallel=True)
def _add(
    shadows: Shadows, directions: Floats, irradiance: Floats, surfaces: Floats, radiance: Floats
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        shadow = packet()
        start_at(surface, shadow)
        light = np.zeros((FIELDS, PACKET), np.float32)
        for s in range(len(directions)):
            for axis in range(3):
                light[TOWARD + axis] = directions[s, axis]
                light[CARRIED + axis] = irradiance[s, axis]
            reflect(shadows, surface, light)
            traced += add_visible_alike(shadows, surface, light, shadow, radiance[k])
    return traced
