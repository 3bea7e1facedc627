"""Whether a bracket's exposures are what they are labelled, judged from its pixels.

Input  : Bracket and Sensor.    Output : stops, per pair of neighbouring exposures.
Cost   : independent of the picture's size: at most 256 × 256 pixels of each frame are read.
Fails  : where the response is only assumed. A camera's own JPEG curve taken for sRGB, or the veil
         of a film scan, disagrees by a stop in many pairs though every label is right. The order
         of two exposures does not depend on the response, so it can always be trusted.
"""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.frame import Bracket, Frame
from capture.sensor import Sensor

WARNING_EV = 0.3
"""From this disagreement on, radiance steps visibly where an exposure saturates."""

REFUSAL_EV = 1.0
"""From this disagreement on labels are wrong, if the response is known: linear or measured."""

_SIDE_PX = 256
_FEWEST_VALUES = 100
_LARGEST_NOISE = 0.1


def exposure_warning(bracket: Bracket, sensor: Sensor) -> str:
    """Return one line about labels that the pixels contradict, or "" where there are none.

    Raises
    ------
    InputError
        If the exposure of larger signal is the darker by more than 0.3 EV, whatever the response;
        if linear counts, or those of a measured response, disagree with their labels by more than
        1 EV; or if the counts cannot be the sensor's.
    """
    frames = bracket.by_signal()
    is_known = (
        sensor.response is None
        or sensor.response_deviation is not None
        or frames[0].counts.dtype == np.float32
    )
    warning, largest = "", WARNING_EV
    disagreements = exposure_disagreement_ev(bracket, sensor)
    for (a, b), disagreement in zip(pairwise(frames), disagreements, strict=True):
        labelled = _labelled_ev(a, b)
        measured = labelled + disagreement
        line = (
            f"bracket {bracket.index}: frames {a.index} ({a.exposure.time_s:g} s) and {b.index} "
            f"({b.exposure.time_s:g} s) are {labelled:.1f} EV apart by their labels and "
            f"{measured:.1f} EV by their pixels; check their exposures, or the camera's response "
            f"({sensor.source})"
        )
        if measured < -WARNING_EV or (is_known and abs(disagreement) > REFUSAL_EV):
            raise InputError(line)
        if abs(disagreement) > largest:
            warning, largest = line, abs(disagreement)
    return warning


def exposure_disagreement_ev(bracket: Bracket, sensor: Sensor) -> NDArray[np.float64]:
    """Return measured minus labelled exposure ratio, in stops, (exposures − 1,).

    Entry j compares exposures j and j + 1 in rising order of their labelled signal: the median
    over pixels of log2(linear value in j + 1 / linear value in j), less the labelled ratio. It is
    0 ± 0.1 for right labels and a right response, and NaN where fewer than 100 values are usable
    in both: below saturation, and with noise of less than a tenth of the value.

    Parameters
    ----------
    bracket : Bracket
        In any order. A single exposure has no pair and gives (0,).
    sensor : Sensor
        Of float counts, which are linear and have no noise model, every positive one is usable.
    """
    frames = bracket.by_signal()
    sensor.check_counts(frames[0].counts.dtype)
    values = [_usable_values(frame, sensor) for frame in frames]
    measured = [_median_log2_ratio(shorter, longer) for shorter, longer in pairwise(values)]
    labelled = [_labelled_ev(a, b) for a, b in pairwise(frames)]
    return np.array(measured, np.float64) - np.array(labelled, np.float64)


def _labelled_ev(a: Frame, b: Frame) -> float:
    return math.log2(b.exposure.signal / a.exposure.signal)


def _median_log2_ratio(shorter: NDArray[np.float64], longer: NDArray[np.float64]) -> float:
    ratio = longer / shorter
    ratio = ratio[np.isfinite(ratio)]
    return float(np.median(np.log2(ratio))) if ratio.size >= _FEWEST_VALUES else np.nan


def _usable_values(frame: Frame, sensor: Sensor) -> NDArray[np.float64]:
    """Return linear values of a subsample of the frame, NaN where they are not usable."""
    width, height = frame.size_px
    counts = frame.counts[:: -(-height // _SIDE_PX), :: -(-width // _SIDE_PX)]
    if counts.dtype == np.float32:
        return np.where(np.isfinite(counts) & (counts > 0), counts, np.nan).astype(np.float64)
    channel = np.arange(3)
    linear = sensor.linear_table().astype(np.float64)[counts, channel]
    variance = sensor.variance_table(frame.exposure.gain)[counts, channel]
    usable = (
        (linear < sensor.saturation) & (linear > 0) & (variance < (_LARGEST_NOISE * linear) ** 2)
    )
    return np.where(usable, linear, np.nan)
