"""Peaks of a map: the narrow lights that smooth surfaces mirror by themselves, and the map without.

A pyramid of a map blurs what is small and bright, and a few dozen lights make as many spots on a
metal. So what is narrow is mirrored as a light, and all else as a map.
"""

from dataclasses import replace

import numpy as np

from lighting.export.residual import remove_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.lights.discs import Discs
from render.lights.narrow_lights import PEAK_RAD, narrow_lights

ROUGH_ALPHA = 0.2
"""GGX width of a lobe from which on lights, with their shadows, stand for the map as well as a few
rays of each picture do."""


def without_peaks(environment: EnvironmentMap, lights: Discs) -> tuple[EnvironmentMap, Discs]:
    """Return a map without the narrow lights among some, and these with what they had in it.

    Those are mirrored by themselves, all others by the map.
    """
    peaks = narrow_lights(lights.irradiance, lights.radius_rad, PEAK_RAD)
    of = lights.taken(peaks)
    rest, removed = remove_lights(
        environment, LightSet(of.directions, of.irradiance, of.radius_rad)
    )
    mirrored = np.zeros_like(lights.irradiance)
    mirrored[peaks] = removed
    return rest, replace(lights, mirrored=mirrored)
