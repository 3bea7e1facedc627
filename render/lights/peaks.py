"""Peaks of a map: the narrow lights that smooth surfaces mirror by themselves, and the map without.

A pyramid of a map blurs what is small and bright, and a few dozen lights make as many spots on a
metal. So what is narrow is mirrored as a light, and all else as a map.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.export.residual import remove_lights
from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from render.lights.discs import Discs
from render.lights.narrow_lights import PEAK_RAD, narrow_lights

ROUGH_ALPHA = 0.2
"""GGX width of a lobe from which on lights, with their shadows, stand for the map as well as a few
rays of each picture do."""


_LEAST_SHARE = 0.002
_BRIGHT = 10.0
"""Least share of the light, and least radiance over the mean of all directions, of a disc that is a
peak though it is not among the strongest: a lamp, and no cell of a sky."""


def without_peaks(environment: EnvironmentMap, lights: Discs) -> tuple[EnvironmentMap, Discs]:
    """Return a map without the peaks among some lights, and these with what they had in it.

    Those are mirrored by themselves, all others by the map.
    """
    peaks = _are_peaks(lights)
    of = lights.taken(peaks)
    rest, removed = remove_lights(
        environment, LightSet(of.directions, of.irradiance, of.radius_rad)
    )
    mirrored = np.zeros_like(lights.irradiance)
    mirrored[peaks] = removed
    return rest, replace(lights, mirrored=mirrored)


def _are_peaks(lights: Discs) -> NDArray[np.bool_]:
    power = lights.irradiance @ LUMINANCE_WEIGHTS
    share = power / max(power.sum(), np.finfo(np.float64).tiny)
    radius_rad = lights.radius_rad
    is_lamp = (radius_rad > 0) & (radius_rad < PEAK_RAD) & (share >= _LEAST_SHARE)
    is_lamp &= share >= _BRIGHT * np.sin(radius_rad) ** 2 / 4
    return is_lamp | narrow_lights(lights.irradiance, radius_rad, PEAK_RAD)
