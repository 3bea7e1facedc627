"""How bright the scene is, read from one bracket: the range that exposures have to cover.

Input  : Bracket and Sensor.    Output : SceneRange, in relative radiance.
Cost   : a histogram of every frame, about 1 ms for a megapixel of 8 bits, 10 ms of 16 bits.
Fails  : a pixel that is stuck at white in every exposure looks like a sun that is clipped; from
         two values in a million on, it keeps the shortest exposure at the camera's shortest.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.frame import Bracket, Frame
from capture.sensor import Sensor, clear_level

CLIPPED_SHARE = 2e-6
"""Values (of pixels and channels) that may be clipped: fewer than the sun's disc has in a fisheye
picture of 500 pixels across, more than a hot pixel has in one of a megapixel."""

DARK_LIGHT_SHARE = 0.01
"""Share of all light whose pixels are too dark to matter. Of light, not of pixels: the black around
a fisheye's image circle asks for no exposure."""

_HIDDEN_SNR = 2.0


@dataclass(frozen=True)
class SceneRange:
    """Radiance between which the pixels lie that matter.

    Attributes
    ----------
    darkest : float
        The values below hold DARK_LIGHT_SHARE of the light; 0 where noise hides how dark they are.
    brightest : float
        At most CLIPPED_SHARE of the values lie above; infinite where they clip everywhere.
    """

    darkest: float
    brightest: float


UNKNOWN_RANGE = SceneRange(0.0, math.inf)


def scene_range(bracket: Bracket, sensor: Sensor) -> SceneRange:
    """Return the range of a bracket's values; raises InputError if they cannot be the sensor's."""
    radiance, share = radiance_distribution(bracket, sensor)
    above = 1.0 - np.cumsum(share)  # share of the values above each level, clipped ones included
    brightest = math.inf
    if 1.0 - share.sum() <= CLIPPED_SHARE:
        brightest = float(radiance[np.argmax(above <= CLIPPED_SHARE)])
    light = np.cumsum(share * radiance)
    if light.size == 0 or light[-1] <= 0.0:
        return SceneRange(0.0, brightest)
    darkest = float(radiance[np.argmax(light >= DARK_LIGHT_SHARE * light[-1])])
    longest = bracket.by_signal()[-1].exposure
    is_hidden = darkest * longest.signal < clear_level(sensor, longest.gain, _HIDDEN_SNR)
    return SceneRange(0.0 if is_hidden else darkest, brightest)


def radiance_distribution(
    bracket: Bracket, sensor: Sensor
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the levels of radiance in a bracket, rising, and the share of values at each, (n,).

    A value counts at the longest exposure that holds it: of the exposure's histogram, the part
    above the saturation of the next longer one, scaled to the share that one left over. So frames
    are compared by their histograms alone, and what moves between them does no harm. The shares add
    up to 1 less the share that is clipped in every exposure. Counts below black count as black.
    """
    levels, shares = [np.empty(0)], [np.empty(0)]
    remaining, floor = 1.0, -math.inf
    for frame in reversed(bracket.by_signal()):
        sensor.check_counts(frame.counts.dtype)
        linear, share = _linear_values(frame, sensor)
        radiance = np.maximum(linear, 0.0) / frame.exposure.signal
        is_new = radiance >= floor
        is_held = is_new & (linear < sensor.saturation)
        new_share = share[is_new].sum()
        if new_share > 0.0:
            scale = remaining / new_share
            order = np.argsort(radiance[is_held], kind="stable")
            levels.append(radiance[is_held][order])
            shares.append(share[is_held][order] * scale)
            remaining = float(share[is_new & ~is_held].sum() * scale)
        floor = sensor.saturation / frame.exposure.signal
    return np.concatenate(levels), np.concatenate(shares)


def _linear_values(frame: Frame, sensor: Sensor) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the linear values that occur in a frame, and the share of values that have each."""
    table = _linear_table(sensor)
    counts = np.stack(
        [
            cv2.calcHist([frame.counts], [channel], None, [len(table)], [0, len(table)])
            for channel in range(3)
        ],
        axis=-1,
    )
    occurs = counts > 0
    return table[occurs], counts[occurs].astype(np.float64) / frame.counts.size


@lru_cache(maxsize=4)
def _linear_table(sensor: Sensor) -> NDArray[np.float64]:
    return sensor.linear_table().astype(np.float64)
