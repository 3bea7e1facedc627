"""The merge: one bracket of exposures becomes one picture of radiance.

Domain : relative radiance L; a pixel's expected linear value is L · Exposure.signal.
Input  : Bracket and Sensor.    Output : RadianceImage.
Cost   : 3 exposures of 1024² 8-bit pixels take 10 ms of one core, shared among all; a 16-bit
         response table adds 2 ms whatever the size. The first call for a count type compiles for
         some 3 s; the result is cached on disk.
Fails  : where the scene or the camera moved between the exposures, the merge mixes both; where
         an exposure is mislabelled, radiance steps at its saturation (capture.exposure_check).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from capture.frame import Bracket, Frame
from capture.radiance import RadianceImage, clean_radiance
from capture.sensor import Sensor

_BLOCK_PX = 256
"""Pixels merged at a time, so that the working arrays of six exposures stay in the L1 cache."""

_CONTRADICTION = 4.0
"""Standard deviations by which the shorter exposures must predict saturation to be believed over a
count below it: far enough that noise alone leaves out one value in thirty thousand at most."""


def merge_bracket(bracket: Bracket, sensor: Sensor) -> RadianceImage:
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

    Parameters
    ----------
    bracket : Bracket
        In any order: the result is the same to the bit as long as frames of equal exposure differ
        in timestamp or index.
    sensor : Sensor
        Not used for float counts.

    Raises
    ------
    InputError
        If the sensor's white level does not belong to the type of the counts.
    """
    frames = bracket.by_signal()
    if frames[0].counts.dtype == np.float32:
        return _average(frames)
    sensor.check_counts(frames[0].counts.dtype)
    width, height = frames[0].size_px
    radiance = np.empty((height, width, 3), np.float32)
    variance = np.empty((height, width, 3), np.float32)
    clipped = np.empty((height, width), np.bool_)
    step = 1.0 / (sensor.white_dn - sensor.black_dn)
    _merge_counts(
        _flat_counts(frames),
        np.array([frame.exposure.light for frame in frames], np.float32),
        np.array([1.0 / frame.exposure.gain for frame in frames], np.float32),
        sum(frame.exposure.signal == frames[0].exposure.signal for frame in frames),
        np.empty((0, 3, 2), np.float32) if sensor.response is None else _count_table(sensor),
        np.float32(sensor.black_dn),
        np.float32(step),
        np.float32(sensor.saturation),
        np.float32(1.0 / sensor.full_well_e),
        np.float32((sensor.read_noise_e / sensor.full_well_e) ** 2),
        np.float32(_CONTRADICTION**2),
        radiance.reshape(-1),
        variance.reshape(-1),
        clipped.reshape(-1),
    )
    return RadianceImage(radiance, variance, np.ones((height, width), np.bool_), clipped)


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


def _count_table(sensor: Sensor) -> NDArray[np.float32]:
    """Return (counts, 3, 2): the linear value of each count, and the variance of its step.

    The step is half the distance between the neighbouring levels, so counts that share one level,
    a flat part of an estimated response, are as uncertain as the gap that they leave.
    """
    linear = sensor.linear_table()
    table = np.empty((*linear.shape, 2), np.float32)
    table[..., 0] = linear
    for channel in range(3):
        levels, level_of_count = np.unique(linear[:, channel], return_inverse=True)
        table[:, channel, 1] = (np.gradient(levels) ** 2 / 12.0)[level_of_count]
    return table


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


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _merge_counts(
    frames: tuple[NDArray[Any], ...],
    light: NDArray[np.float32],
    inverse_gain: NDArray[np.float32],
    shortest_count: int,
    table: NDArray[np.float32],
    black_dn: np.float32,
    step: np.float32,
    saturation: np.float32,
    photon_variance: np.float32,
    read_variance: np.float32,
    squared_contradiction: np.float32,
    radiance: NDArray[np.float32],
    variance: NDArray[np.float32],
    clipped: NDArray[np.bool_],
) -> None:
    """Fill `radiance` and `variance` (3P,) and `clipped` (P,) from P pixels of each frame.

    `light` has one entry per exposure, the `shortest_count` first of which are never left out.
    `table` is `_count_table`, or has no rows for the linear response (count − black_dn) · step.
    Variances are in squared linear values at gain 1.

    Every loop over values is free of branches and of reductions, so that it runs in vector
    registers and gives the same bits on any machine.
    """
    zero, one, infinity = np.float32(0), np.float32(1), np.float32(np.inf)
    exposure_count = len(light)
    step_variance = step * step / np.float32(12)
    for block in prange((clipped.size + _BLOCK_PX - 1) // _BLOCK_PX):
        first = block * _BLOCK_PX
        last = min(first + _BLOCK_PX, clipped.size)
        size = 3 * (last - first)
        values = slice(3 * first, 3 * last)
        collected = np.empty((exposure_count, size), np.float32)
        dark_variance = np.empty((exposure_count, size), np.float32)
        pilot = np.zeros(size, np.float32)
        pilot_dark = np.zeros(size, np.float32)
        total_light = np.zeros(size, np.float32)
        full = clipped[first:last]
        full[:] = False

        for k in range(exposure_count):
            counts, y, v = frames[k][values], collected[k], dark_variance[k]
            if len(table) == 0:
                for i in range(size):
                    y[i] = (np.float32(counts[i]) - black_dn) * step
                    v[i] = step_variance
            else:
                for p in range(last - first):
                    for channel in range(3):
                        count = np.intp(counts[3 * p + channel])
                        y[3 * p + channel] = table[count, channel, 0]
                        v[3 * p + channel] = table[count, channel, 1]
            to_base, light_k = inverse_gain[k], light[k]
            if k < shortest_count:
                for p in range(last - first):
                    top = max(y[3 * p], y[3 * p + 1], y[3 * p + 2])
                    full[p] |= top >= saturation
                for i in range(size):
                    y[i] *= to_base
                    v[i] = v[i] * (to_base * to_base) + read_variance
                    pilot[i] += y[i]
                    pilot_dark[i] += v[i]
                    total_light[i] += light_k
                continue
            full_at_base = saturation * to_base
            doubt = squared_contradiction * light_k * light_k
            for i in range(size):
                at_base = y[i] * to_base
                noise = v[i] * (to_base * to_base) + read_variance
                # By how much the shorter exposures predict more than a full pixel, × total_light.
                excess = pilot[i] * light_k - total_light[i] * full_at_base
                spread = doubt * (pilot_dark[i] + photon_variance * pilot[i])
                is_full = (excess > zero) & (excess * excess > spread)
                used = (y[i] < saturation) & ~is_full
                y[i] = at_base if used else zero
                # An infinite variance gives a weight of exactly 0.
                v[i] = noise if used else infinity
                pilot[i] += at_base if used else zero
                pilot_dark[i] += noise if used else zero
                total_light[i] += light_k if used else zero

        estimate, information = radiance[values], variance[values]
        for i in range(size):
            pilot[i] = max(pilot[i] / total_light[i], zero) * photon_variance
            estimate[i] = zero
            information[i] = zero
        for k in range(exposure_count):
            y, v, light_k = collected[k], dark_variance[k], light[k]
            for i in range(size):
                weight = light_k / (light_k * pilot[i] + v[i])
                estimate[i] += weight * y[i]
                information[i] += weight * light_k
        for i in range(size):
            information[i] = one / information[i]
            estimate[i] = max(estimate[i] * information[i], zero)
