"""Holds the exposures of a bracket against its pixels: a frame under another's label stands out.

Input  : samples of each frame, in DN.    Output : what contradicts, in words, or None.
Fails  : where too little of the picture is between dark and full in two exposures, nothing is said.
         A tone curve that is not the sensor's changes the ratios; they are judged loosely, so that
         only a frame that looks like its neighbour, or one changed by more, is found.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.sensor import Sensor

_LEAST_RATIO = 2.0
"""Exposures closer than this look alike enough for a lamp's flicker to hide the difference."""

_LEAST_SHARE = 0.01
"""Of the samples, that must lie between dark and full in both exposures."""

_DARK, _FULL = 0.05, 0.8
"""Linear values between which a sample is compared: above any black level, below white."""

_EXPONENTS = (0.5, 2.0)
"""What power of the exposures' ratio the pixels' ratio may be: steep and flat tone curves pass, two
frames of one exposure (power 0) and exchanged ones (−1) do not."""


def find_contradiction(
    times_s: Sequence[float], samples: Sequence[NDArray[Any]], sensor: Sensor
) -> str | None:
    """Return which two exposures contradict their pixels, or None.

    Parameters
    ----------
    times_s : (N,)
        Exposure time of each frame.
    samples : N of (S,) uint8 or uint16
        The same pixels of each.
    """
    table = sensor.linear_table()[:, 1]
    order = sorted(range(len(times_s)), key=lambda index: times_s[index])
    chain = order[:1]
    for index in order[1:]:
        if times_s[index] >= _LEAST_RATIO * times_s[chain[-1]]:
            chain.append(index)
    for shorter, longer in pairwise(chain):
        dim, bright = table[samples[shorter]], table[samples[longer]]
        usable = (np.minimum(dim, bright) > _DARK) & (np.maximum(dim, bright) < _FULL)
        if np.count_nonzero(usable) < _LEAST_SHARE * usable.size:
            continue
        measured = float(np.median(bright[usable] / dim[usable]))
        expected = times_s[longer] / times_s[shorter]
        if not expected ** _EXPONENTS[0] < measured < expected ** _EXPONENTS[1]:
            return (
                f"{times_s[longer]:.3g} s is {measured:.2g} times as bright as "
                f"{times_s[shorter]:.3g} s"
            )
    return None
