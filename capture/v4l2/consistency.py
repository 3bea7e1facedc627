"""Holds the exposures of a bracket against its pixels: a frame under another's label stands out.

Input  : samples of each frame, in DN.    Output : what contradicts, in words, or None.
Fails  : where too little of the picture is between dark and full, or exposures are close, nothing
         is said. A tone curve that is not the sensor's changes ratios, so they are judged loosely:
         only a frame that looks like its neighbour, or one changed by far too much, is found.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.sensor import Sensor

_Values = NDArray[np.float32]

_LEAST_RATIO = 2.0
"""Exposures closer than this look so alike that a lamp's flicker can hide the difference."""

_LEAST_SHARE = 0.01
"""Of the samples, that must vote."""

_DARK, _DIM, _BRIGHT, _FULL = 0.03, 0.05, 0.8, 0.9
"""Linear values: samples from dim to bright are judged; below dark, which lies above any camera's
black, and above full, one says nothing of the light."""

_CUT_OFF = 0.01
"""Linear value below which a camera may show black."""

_EXPONENTS = (0.5, 1.6)
"""What power of the exposures' ratio the pixels' ratio may be: flat and steep tone curves pass, two
frames of one exposure (power 0) and exchanged ones (−1) do not."""


def find_contradiction(
    times_s: Sequence[float], samples: Sequence[NDArray[Any]], sensor: Sensor
) -> str | None:
    """Return which two exposures contradict their pixels, or None.

    Each sample that is neither dark nor full in one of two exposures votes; the majority counts, so
    that a part of the picture may move or change.

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
        ratio = times_s[longer] / times_s[shorter]
        if _are_too_alike(dim, bright, ratio) or _are_too_different(dim, bright, ratio):
            return (
                f"{times_s[shorter]:.3g} s and {times_s[longer]:.3g} s do not differ in the "
                "picture as they should"
            )
    return None


def _are_too_alike(dim: _Values, bright: _Values, ratio: float) -> bool:
    """Tell whether linear values differ by less than exposures of this ratio would make them."""
    votes = ((bright > _DIM) & (bright < _BRIGHT)) | ((dim > _DIM) & (dim < _BRIGHT))
    against = (bright < ratio ** _EXPONENTS[0] * dim) & (dim > _DARK) & (bright < _FULL)
    return _is_majority(against, votes)


def _are_too_different(dim: _Values, bright: _Values, ratio: float) -> bool:
    """Tell whether linear values differ by more than exposures of this ratio would make them.

    Only values vote whose darker one would be above what a camera may show as black.
    """
    most = ratio ** _EXPONENTS[1]
    votes = (bright > most * _CUT_OFF) & (bright < _BRIGHT)
    return _is_majority(bright > most * dim, votes)


def _is_majority(against: NDArray[np.bool_], votes: NDArray[np.bool_]) -> bool:
    count = np.count_nonzero(votes)
    is_enough = count >= _LEAST_SHARE * votes.size
    return bool(is_enough and 2 * np.count_nonzero(against & votes) > count)
