"""Which lights are so narrow and strong that a picture draws them by themselves."""

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS

Array = NDArray[np.float64]

NARROW_LIGHTS = 8
NARROW_SHARE = 0.02
"""The strongest lights that give at least this share of the light, no more than so many."""

PEAK_RAD = np.radians(3.0)
"""A narrow light up to this radius is a peak of the map, whose reflection is drawn by itself."""


def narrow_lights(irradiance: Array, radius_rad: Array, widest_rad: float) -> NDArray[np.bool_]:
    """Return which lights (K,) are strong, and narrower than `widest_rad`."""
    power = irradiance @ LUMINANCE_WEIGHTS
    strong = (power >= NARROW_SHARE * power.sum()) & (radius_rad < widest_rad)
    chosen = np.argsort(-power * strong, kind="stable")[:NARROW_LIGHTS]
    narrow = np.zeros(len(power), np.bool_)
    narrow[chosen] = strong[chosen]
    return narrow
