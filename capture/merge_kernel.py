"""The sums of the merge, compiled: every pixel of every exposure, once.

Input  : counts of each exposure, in the order of capture.merge.
Output : radiance, variance and the mark `clipped`, written into arrays that the caller owns.
Cost   : see tests/benchmarks/merge.py. Nothing is allocated but some kilobytes for each thread.

A block of pixels at a time passes through a row of short loops. Each loop is a function of its own,
free of branches, of reductions and of slices, because only then does it run in vector registers,
and gives the same bits on any machine.
"""

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

_BLOCK_PX = 512
"""Pixels merged at a time, so that the working arrays of three exposures stay in the L1 cache."""

_BLOCK_VALUES = 3 * _BLOCK_PX

_TASK_PX = 32 * _BLOCK_PX
"""Pixels that share one set of working arrays: the unit of work of a thread."""


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def merge_counts(
    frames: tuple[NDArray[Any], ...],
    light: NDArray[np.float32],
    inverse_gain: NDArray[np.float32],
    shortest_count: int,
    table: NDArray[np.float64],
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
    `table` (counts, 3) holds a count's linear value and step variance, two float32 in the bits of
    one float64; it has no rows for the linear response (count − black_dn) · step. Variances are in
    squared linear values at gain 1.
    """
    for task in prange((clipped.size + _TASK_PX - 1) // _TASK_PX):
        pairs = np.zeros(_BLOCK_VALUES)
        collected = np.zeros((len(light), _BLOCK_VALUES), np.float32)
        noise = np.zeros((len(light), _BLOCK_VALUES), np.float32)
        pilot = np.empty(_BLOCK_VALUES, np.float32)
        pilot_noise = np.empty(_BLOCK_VALUES, np.float32)
        total_light = np.empty(_BLOCK_VALUES, np.float32)
        estimate = np.empty(_BLOCK_VALUES, np.float32)
        information = np.empty(_BLOCK_VALUES, np.float32)
        for first in range(_TASK_PX * task, min(_TASK_PX * (task + 1), clipped.size), _BLOCK_PX):
            last = min(first + _BLOCK_PX, clipped.size)
            values, full = slice(3 * first, 3 * last), clipped[first:last]
            _clear(pilot, pilot_noise, total_light, full)
            for k in range(len(light)):
                counts, to_base, light_k = frames[k][values], inverse_gain[k], light[k]
                if len(table) == 0:
                    _scale(counts, black_dn, step, k, to_base, read_variance, collected, noise)
                else:
                    _look_up(counts, table, pairs)
                    _part(pairs.view(np.float32), k, to_base, read_variance, collected, noise)
                full_at_base = saturation * to_base
                if k < shortest_count:
                    _mark_full(collected, k, full_at_base, full)
                    _keep(collected, noise, k, light_k, pilot, pilot_noise, total_light)
                else:
                    doubt = squared_contradiction * light_k * light_k
                    _choose(
                        collected, noise, k, light_k, full_at_base, doubt, photon_variance,
                        pilot, pilot_noise, total_light,
                    )  # fmt: skip
            _begin(photon_variance, pilot, estimate, information)
            for k in range(len(light)):
                _weigh(collected, noise, k, light[k], pilot, total_light, estimate, information)
            _finish(estimate, information, total_light, radiance[values], variance[values])


@njit(cache=True, nogil=True, error_model="numpy")
def _clear(pilot, pilot_noise, total_light, full):  # type: ignore[no-untyped-def]
    for i in range(_BLOCK_VALUES):
        pilot[i] = np.float32(0)
        pilot_noise[i] = np.float32(0)
        total_light[i] = np.float32(0)
    for p in range(len(full)):
        full[p] = False


@njit(cache=True, nogil=True, error_model="numpy")
def _scale(counts, black_dn, step, k, to_base, read_variance, collected, noise):  # type: ignore[no-untyped-def]
    """Fill row k of `collected` and `noise` with linear counts."""
    value_scale = step * to_base
    constant_noise = value_scale * value_scale / np.float32(12) + read_variance
    for i in range(len(counts)):
        collected[k, i] = (np.float32(counts[i]) - black_dn) * value_scale
        noise[k, i] = constant_noise


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(counts, table, pairs):  # type: ignore[no-untyped-def]
    """Look up a value and its variance together: one load and one store in place of two."""
    for p in range(len(counts) // 3):
        i = 3 * p
        pairs[i] = table[np.uintp(counts[i]), 0]
        pairs[i + 1] = table[np.uintp(counts[i + 1]), 1]
        pairs[i + 2] = table[np.uintp(counts[i + 2]), 2]


@njit(cache=True, nogil=True, error_model="numpy")
def _part(pairs, k, to_base, read_variance, collected, noise):  # type: ignore[no-untyped-def]
    """Fill row k of `collected` and `noise` from pairs of linear value and step variance."""
    for i in range(_BLOCK_VALUES):
        collected[k, i] = pairs[2 * i] * to_base
        noise[k, i] = pairs[2 * i + 1] * (to_base * to_base) + read_variance


@njit(cache=True, nogil=True, error_model="numpy")
def _mark_full(collected, k, full_at_base, full):  # type: ignore[no-untyped-def]
    for p in range(len(full)):
        top = max(collected[k, 3 * p], collected[k, 3 * p + 1], collected[k, 3 * p + 2])
        full[p] |= top >= full_at_base


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(collected, noise, k, light, pilot, pilot_noise, total_light):  # type: ignore[no-untyped-def]
    """Add an exposure that is never left out to the pilot's sums."""
    for i in range(_BLOCK_VALUES):
        pilot[i] += collected[k, i]
        pilot_noise[i] += noise[k, i]
        total_light[i] += light


@njit(cache=True, nogil=True, error_model="numpy")
def _choose(  # type: ignore[no-untyped-def]
    collected, noise, k, light, full_at_base, doubt, photon_variance,
    pilot, pilot_noise, total_light,
):  # fmt: skip
    """Add to the pilot's sums what is below saturation and not contradicted; leave out the rest."""
    zero, infinity = np.float32(0), np.float32(np.inf)
    for i in range(_BLOCK_VALUES):
        # By how much the shorter exposures predict more than a full pixel, × total_light.
        excess = pilot[i] * light - total_light[i] * full_at_base
        spread = doubt * (pilot_noise[i] + photon_variance * pilot[i])
        is_full = (excess > zero) & (excess * excess > spread)
        used = (collected[k, i] < full_at_base) & ~is_full
        collected[k, i] = collected[k, i] if used else zero
        pilot[i] += collected[k, i]
        pilot_noise[i] += noise[k, i] if used else zero
        # An infinite variance gives a weight of exactly 0.
        noise[k, i] = noise[k, i] if used else infinity
        total_light[i] += light if used else zero


@njit(cache=True, nogil=True, error_model="numpy")
def _begin(photon_variance, pilot, estimate, information):  # type: ignore[no-untyped-def]
    """Make of the pilot's sum the photon noise that it predicts, × total_light."""
    for i in range(_BLOCK_VALUES):
        pilot[i] = max(pilot[i], np.float32(0)) * photon_variance
        estimate[i] = np.float32(0)
        information[i] = np.float32(0)


@njit(cache=True, nogil=True, error_model="numpy")
def _weigh(collected, noise, k, light, pilot, total_light, estimate, information):  # type: ignore[no-untyped-def]
    """Add an exposure by the inverse of its variance, / total_light, which spares a division."""
    for i in range(_BLOCK_VALUES):
        weight = light / (light * pilot[i] + noise[k, i] * total_light[i])
        estimate[i] += weight * collected[k, i]
        information[i] += weight * light


@njit(cache=True, nogil=True, error_model="numpy")
def _finish(estimate, information, total_light, radiance, variance):  # type: ignore[no-untyped-def]
    for i in range(len(radiance)):
        scale = np.float32(1) / information[i]
        radiance[i] = max(estimate[i] * scale, np.float32(0))
        variance[i] = scale / total_light[i]
