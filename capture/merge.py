"""The merge: one bracket of exposures becomes one picture of radiance.

Domain : relative radiance L; a pixel's expected linear value is L · Exposure.signal.
Input  : Bracket and Sensor.    Output : RadianceImage.
Cost   : see tests/benchmarks/merge.py. The tables of a 16-bit response take 2 ms to make, once for
         a sensor. The first call for a count type compiles for some 3 s, cached on disk.
Fails  : where the scene or the camera moved between the exposures, the merge mixes both
         (capture.alignment, capture.ghosts); where an exposure is mislabelled, radiance steps at
         its saturation (capture.exposure_check).
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.frame import Bracket, Frame
from capture.merge_colours import in_colours
from capture.merge_kernel import merge_counts, merge_counts_alone
from capture.picture_memory import PictureMemory
from capture.radiance import RadianceImage, clean_radiance
from capture.sensor import Sensor

_CONTRADICTION = 4.0
"""Standard deviations by which the shorter exposures must predict saturation to be believed over a
count below it: far enough that noise alone leaves out one value in thirty thousand at most."""


def merge_bracket(
    bracket: Bracket,
    sensor: Sensor,
    memory: PictureMemory | None = None,
    *,
    is_beside: bool = False,
) -> RadianceImage:
    """Return the maximum-likelihood radiance of a bracket, with its variance and its marks.

    Exposure k collects y_k = x_k / gain_k, its linear value at gain 1, with
    E[y_k] = light_k · L and

        Var[y_k] = v_k = light_k · L / full_well + (read_noise / full_well)² + (Δ_k / gain_k)² / 12,

    photon, read and quantisation noise, Δ_k being the linear step of the count that was read. Per
    pixel and channel,

        L = Σ (light_k / v_k) y_k / Σ (light_k / v_k) light_k,    Var[L] = 1 / Σ light_k² / v_k,

    over the exposures below saturation, with L inside v_k taken from the pilot Σ y_k / Σ light_k.
    The pilot is the estimator of Hanji, Zhong and Mantiuk, "Noise-Aware Merging of High Dynamic
    Range Image Stacks without Camera Calibration" (2020). Where photon noise dominates, the
    result equals it; in deep shadow, a thousandth of the longest exposure's range, its rms error is
    15 to 30 % smaller, and short exposures that the camera cut off at black hardly lift it
    (tests/limits/test_merge_deep_shadow.py).

    An exposure is left out as well where the shorter ones, by four standard deviations, predict
    that it is full: beside a clipped sun a JPEG's ringing brings full pixels back below white, and
    merging them would hide much of the sun (tests/limits/test_merge_ringing.py).

    Only the sum is cut off at 0, never a term: noise around black averages out.

    The exposures of smallest `signal`, which clip last, are never left out: a pixel clipped
    everywhere gets the lower bound x / signal and the mark `clipped`. An exposure is left out by
    its own noisy value, which biases L near the threshold by at most −0.4 standard deviations of
    that exposure (tests/limits/test_merge_selection_bias.py).

    Float counts are linear and have no noise model: their radiance is Σ y_k / Σ light_k, cleaned by
    `clean_radiance`, with variance 0, clipped where a frame says so.

    All this is done in the camera's own channels; capture.merge_colours then makes the sensor's
    primaries of them.

    Parameters
    ----------
    bracket : Bracket
        In any order: the result is the same to the bit as long as frames of equal exposure differ
        in timestamp or index.
    sensor : Sensor
        Of float counts only its colours are used.
    memory : PictureMemory or None
        Where the picture goes, for a stream of brackets: nothing is then allocated for each. Not
        used for float counts.
    is_beside : bool
        Merge on the calling thread alone, beside the one that owns all parallel kernels.

    Raises
    ------
    InputError
        If the sensor's white level does not belong to the type of the counts.
    """
    frames = bracket.by_signal()
    if frames[0].counts.dtype == np.float32:
        return in_colours(_average(frames), sensor)
    sensor.check_counts(frames[0].counts.dtype)
    picture = (memory or PictureMemory()).arrays(frames[0].size_px)
    picture.valid[:] = True
    step = 1.0 / (sensor.white_dn - sensor.black_dn)
    merge = merge_counts_alone if is_beside else merge_counts
    merge(
        _flat_counts(frames),
        np.array([frame.exposure.light for frame in frames], np.float32),
        np.array([1.0 / frame.exposure.gain for frame in frames], np.float32),
        sum(frame.exposure.signal == frames[0].exposure.signal for frame in frames),
        _count_table(sensor),
        np.float32(sensor.black_dn),
        np.float32(step),
        np.float32(sensor.saturation),
        np.float32(1.0 / sensor.full_well_e),
        np.float32((sensor.read_noise_e / sensor.full_well_e) ** 2),
        np.float32(_CONTRADICTION**2),
        picture.radiance.reshape(-1),
        picture.variance.reshape(-1),
        picture.clipped.reshape(-1),
    )
    return in_colours(RadianceImage(*picture), sensor, 1.0 / frames[0].exposure.signal)


def _average(frames: Sequence[Frame]) -> RadianceImage:
    """Return Σ y_k / Σ light_k of float frames, not valid where any of them is not finite.

    A pixel that any of them marks as clipped is clipped.
    """
    light = sum(frame.exposure.light for frame in frames)
    total = np.zeros(frames[0].counts.shape, np.float64)
    with np.errstate(invalid="ignore"):  # ∞ − ∞ is cleaned below
        for frame in frames:
            total += frame.counts / np.float64(frame.exposure.gain * light)
    cleaned = clean_radiance(total)
    clipped = np.zeros(cleaned.valid.shape, np.bool_)
    for frame in frames:
        if frame.clipped is not None:
            clipped |= frame.clipped
    return RadianceImage(cleaned.radiance, np.zeros_like(cleaned.radiance), cleaned.valid, clipped)


@lru_cache(maxsize=8)
def _count_table(sensor: Sensor) -> NDArray[np.uint64]:
    """Return (3, counts): the linear value of each count and the variance of its step.

    Both are float32 in the bits of one integer, so that one load brings both. A linear response
    needs no table: it has no columns.
    """
    if sensor.response is None:
        return np.empty((3, 0), np.uint64)
    table = np.stack([sensor.linear_table().T, sensor.step_variance_table().T], axis=-1)
    return table.astype(np.float32).view(np.uint64)[..., 0].copy()


def _flat_counts(frames: Sequence[Frame]) -> tuple[NDArray[Any], ...]:
    """Return the counts of each frame as one row, and rows repeated up to 4, 8, 16, … in all.

    A tuple's length is part of its compiled type; few lengths mean few compilations.
    """
    rows = []
    for frame in frames:
        row = np.ascontiguousarray(frame.counts).reshape(-1)
        row.flags.writeable = False  # also part of the type: a copy would be writeable
        rows.append(row)
    length = max(4, 1 << (len(rows) - 1).bit_length())
    return tuple(rows + rows[:1] * (length - len(rows)))
