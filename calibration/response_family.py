"""What tone curves look like: the mean and the main variations of many plausible ones.

Brackets whose exposures are all in one ratio cannot tell a response from the same one rippled with
that ratio's period, however many patches they have (M. D. Grossberg and S. K. Nayar, "What can be
known about the radiometric response function from images?", ECCV 2002). Only what a curve may look
like decides, so it is said here.

Domain : log g(z), g the linear value of count z, over its value at the middle count.
Output : mean (256,) and components (256, M), scaled so that a plausible curve is the mean plus the
         components times independent numbers of variance 1, the largest variations first.
Cost   : 0.1 s, once.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from calibration.response_curve import COUNTS, MIDDLE_COUNT

COMPONENTS = 14
_LEAST_COMPONENT = 0.02
"""Least Euclidean norm of a component over the counts: real curves are less tidy than formulas."""
_CURVES = 2000
_LIGHT_STEPS = 4096
_LEAST_LIGHT = 1e-7


@cache
def curve_family() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and components of the family, from its covariance over counts 1 to 255.

    Count 0 has no logarithm and takes the place of a count of ½.
    """
    draws = np.random.default_rng(0).standard_normal((_CURVES, 5))
    logs = np.array([_log_response(*draw) for draw in draws])
    mean = logs.mean(axis=0)
    _, spread, components = np.linalg.svd(logs - mean, full_matrices=False)
    size = np.maximum(spread[:COMPONENTS] / np.sqrt(_CURVES - 1), _LEAST_COMPONENT)
    return mean, components[:COMPONENTS].T * size


def _log_response(
    gamma: float, offset: float, contrast: float, shoulder: float, skew: float
) -> NDArray[np.float64]:
    """Return log g relative to the middle count, (256,), for standard normal parameters.

    A power with a straight toe, as sRGB and Rec.709 have it; in front of it a shoulder that bends
    the highlights, after it an S that adds contrast around a skewed middle.
    """
    light = np.geomspace(_LEAST_LIGHT, 1.0, _LIGHT_STEPS)
    bend = np.exp(shoulder) - 0.3 if shoulder > -1.2 else 0.0
    bent = light * (1.0 + bend) / (1.0 + bend * light)
    power = 2.2 * np.exp(0.15 * gamma)
    coded = _toed_power(bent, power, 0.06 * abs(offset))
    steepness = np.exp(0.1 + 0.15 * contrast)
    bright = coded**steepness
    dark = (np.exp(0.25 * skew) * (1.0 - coded)) ** steepness
    coded = bright / (bright + dark)
    counts = np.maximum(COUNTS, 0.5) / 255.0
    # Below the least light every toe here is a straight line through black.
    log_light = np.interp(np.log(counts), np.log(coded), np.log(light))
    return log_light - log_light[MIDDLE_COUNT]


def _toed_power(light: NDArray[np.float64], power: float, offset: float) -> NDArray[np.float64]:
    """Return (1 + a) E^(1/γ) − a, with the tangent through black below where it touches."""
    if offset < 1e-3:
        return light ** (1.0 / power)
    touch = (offset * power / ((power - 1.0) * (1.0 + offset))) ** power
    slope = (1.0 + offset) * touch ** (1.0 / power - 1.0) / power
    above = (1.0 + offset) * light ** (1.0 / power) - offset
    return np.where(light < touch, slope * light, above)
