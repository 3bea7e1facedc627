"""The sums of the merge, compiled: every pixel of every exposure, once.

Input  : counts of each exposure, in the order of capture.merge.
Output : radiance, variance and the mark `clipped`, written into arrays that the caller owns.
Cost   : see tests/benchmarks/merge.py. Nothing is allocated but some kilobytes for each thread. A
third of it goes to looking counts up, at three accesses to memory each.

A block of pixels at a time passes through a row of short loops. Each loop is a function of its own,
free of branches, of reductions and of slices, because only then does it run in vector registers,
and gives the same bits on any machine. They share one array, the rows of which begin on a line of
the cache: a vector that lies on two lines takes twice as long.
"""

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

_BLOCK_PX = 512
"""Pixels merged at a time: few enough for the caches next to the core, enough that starting the
loops does not show."""

_BLOCK_VALUES = 3 * _BLOCK_PX

_TASK_PX = 32 * _BLOCK_PX
"""Pixels that share one set of working arrays: the unit of work of a thread."""

# Rows of the working array. The pilot's sums: of values, of their variances and of light; then the
# sums of the estimate; then each exposure's values and their variances.
_PILOT, _PILOT_NOISE, _TOTAL_LIGHT, _ESTIMATE, _INFORMATION, _FIRST_EXPOSURE = range(6)

_LINE_FLOATS = 16


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def merge_counts(
    frames: tuple[NDArray[Any], ...],
    light: NDArray[np.float32],
    inverse_gain: NDArray[np.float32],
    shortest_count: int,
    table: NDArray[np.uint64],
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
    `table` (3, counts) holds a count's linear value and step variance, two float32 in the bits of
    one integer; it has no columns for the linear response (count − black_dn) · step. Variances are
    in squared linear values at gain 1.
    """
    for task in prange((clipped.size + _TASK_PX - 1) // _TASK_PX):
        _merge_task(
            task, frames, light, inverse_gain, shortest_count, table, black_dn, step, saturation,
            photon_variance, read_variance, squared_contradiction, radiance, variance, clipped,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def merge_counts_alone(  # type: ignore[no-untyped-def]
    frames, light, inverse_gain, shortest_count, table, black_dn, step, saturation,
    photon_variance, read_variance, squared_contradiction, radiance, variance, clipped,
):  # fmt: skip
    """Do what `merge_counts` does, to the bit, on the thread that calls."""
    for task in range((clipped.size + _TASK_PX - 1) // _TASK_PX):
        _merge_task(
            task, frames, light, inverse_gain, shortest_count, table, black_dn, step, saturation,
            photon_variance, read_variance, squared_contradiction, radiance, variance, clipped,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _merge_task(  # type: ignore[no-untyped-def]
    task, frames, light, inverse_gain, shortest_count, table, black_dn, step, saturation,
    photon_variance, read_variance, squared_contradiction, radiance, variance, clipped,
):  # fmt: skip
    work = _aligned(_FIRST_EXPOSURE + 2 * len(light), _BLOCK_VALUES)
    values_and_steps = _aligned(1, 2 * _BLOCK_VALUES)[0]
    values_and_steps[:] = 0
    pairs = values_and_steps.view(np.uint64)
    for first in range(_TASK_PX * task, min(_TASK_PX * (task + 1), clipped.size), _BLOCK_PX):
        last = min(first + _BLOCK_PX, clipped.size)
        values, full = slice(3 * first, 3 * last), clipped[first:last]
        _clear(work, full)
        for k in range(len(light)):
            counts, to_base, light_k = frames[k][values], inverse_gain[k], light[k]
            if table.size == 0:
                _scale(counts, black_dn, step, values_and_steps)
            else:
                _look_up(counts, table[0], table[1], table[2], pairs)
            row, full_at_base = _FIRST_EXPOSURE + 2 * k, saturation * to_base
            if k < shortest_count:
                _keep(values_and_steps, to_base, read_variance, light_k, work, row)
                _mark_full(work, row, full_at_base, full)
            else:
                doubt = squared_contradiction * light_k * light_k
                _choose(
                    values_and_steps, to_base, read_variance, light_k, full_at_base, doubt,
                    photon_variance, work, row,
                )  # fmt: skip
        _begin(photon_variance, work)
        for k in range(len(light)):
            _weigh(light[k], work, _FIRST_EXPOSURE + 2 * k)
        _finish(work, radiance[values], variance[values])


@njit(cache=True, nogil=True, error_model="numpy")
def _aligned(rows, columns):  # type: ignore[no-untyped-def]
    """Return a float32 array whose rows begin on lines of the cache, if `columns` fill lines."""
    memory = np.empty(rows * columns + _LINE_FLOATS, np.float32)
    skip = -(memory.ctypes.data // 4) % _LINE_FLOATS
    return memory[skip : skip + rows * columns].reshape(rows, columns)


@njit(cache=True, nogil=True, error_model="numpy")
def _clear(work, full):  # type: ignore[no-untyped-def]
    for i in range(_BLOCK_VALUES):
        work[_PILOT, i] = np.float32(0)
        work[_PILOT_NOISE, i] = np.float32(0)
        work[_TOTAL_LIGHT, i] = np.float32(0)
    for p in range(len(full)):
        full[p] = False


@njit(cache=True, nogil=True, error_model="numpy")
def _scale(counts, black_dn, step, values_and_steps):  # type: ignore[no-untyped-def]
    """Fill pairs of linear value and step variance from linear counts."""
    step_variance = step * step / np.float32(12)
    for i in range(len(counts)):
        values_and_steps[2 * i] = (np.float32(counts[i]) - black_dn) * step
        values_and_steps[2 * i + 1] = step_variance


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(counts, red, green, blue, pairs):  # type: ignore[no-untyped-def]
    """Look up a value and its variance together: one load and one store in place of two."""
    for p in range(len(counts) // 3):
        i = np.uintp(3 * p)
        pairs[i] = red[np.uintp(counts[i])]
        pairs[i + 1] = green[np.uintp(counts[i + 1])]
        pairs[i + 2] = blue[np.uintp(counts[i + 2])]


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(values_and_steps, to_base, read_variance, light, work, row):  # type: ignore[no-untyped-def]
    """Add an exposure that is never left out to the pilot's sums."""
    for i in range(_BLOCK_VALUES):
        collected = values_and_steps[2 * i] * to_base
        noise = values_and_steps[2 * i + 1] * (to_base * to_base) + read_variance
        work[row, i] = collected
        work[row + 1, i] = noise
        work[_PILOT, i] += collected
        work[_PILOT_NOISE, i] += noise
        work[_TOTAL_LIGHT, i] += light


@njit(cache=True, nogil=True, error_model="numpy")
def _mark_full(work, row, full_at_base, full):  # type: ignore[no-untyped-def]
    for p in range(len(full)):
        full[p] |= max(work[row, 3 * p], work[row, 3 * p + 1], work[row, 3 * p + 2]) >= full_at_base


@njit(cache=True, nogil=True, error_model="numpy")
def _choose(  # type: ignore[no-untyped-def]
    values_and_steps, to_base, read_variance, light, full_at_base, doubt, photon_variance,
    work, row,
):  # fmt: skip
    """Add to the pilot's sums what is below saturation and not contradicted; leave out the rest."""
    zero, infinity = np.float32(0), np.float32(np.inf)
    for i in range(_BLOCK_VALUES):
        collected = values_and_steps[2 * i] * to_base
        noise = values_and_steps[2 * i + 1] * (to_base * to_base) + read_variance
        # By how much the shorter exposures predict more than a full pixel, × total light.
        excess = work[_PILOT, i] * light - work[_TOTAL_LIGHT, i] * full_at_base
        spread = doubt * (work[_PILOT_NOISE, i] + photon_variance * work[_PILOT, i])
        is_full = (excess > zero) & (excess * excess > spread)
        used = (collected < full_at_base) & ~is_full
        work[row, i] = collected if used else zero
        # An infinite variance gives a weight of exactly 0.
        work[row + 1, i] = noise if used else infinity
        work[_PILOT, i] += collected if used else zero
        work[_PILOT_NOISE, i] += noise if used else zero
        work[_TOTAL_LIGHT, i] += light if used else zero


@njit(cache=True, nogil=True, error_model="numpy")
def _begin(photon_variance, work):  # type: ignore[no-untyped-def]
    """Make of the pilot's sum the photon noise that it predicts, × total light."""
    for i in range(_BLOCK_VALUES):
        work[_PILOT, i] = max(work[_PILOT, i], np.float32(0)) * photon_variance
        work[_ESTIMATE, i] = np.float32(0)
        work[_INFORMATION, i] = np.float32(0)


@njit(cache=True, nogil=True, error_model="numpy")
def _weigh(light, work, row):  # type: ignore[no-untyped-def]
    """Add an exposure by the inverse of its variance, / total light, which spares a division."""
    for i in range(_BLOCK_VALUES):
        weight = light / (light * work[_PILOT, i] + work[row + 1, i] * work[_TOTAL_LIGHT, i])
        work[_ESTIMATE, i] += weight * work[row, i]
        work[_INFORMATION, i] += weight * light


@njit(cache=True, nogil=True, error_model="numpy")
def _finish(work, radiance, variance):  # type: ignore[no-untyped-def]
    for i in range(len(radiance)):
        scale = np.float32(1) / work[_INFORMATION, i]
        radiance[i] = max(work[_ESTIMATE, i] * scale, np.float32(0))
        variance[i] = scale / work[_TOTAL_LIGHT, i]
