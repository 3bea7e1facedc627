"""Passes over a picture, added until its error is small enough; what was added can be kept.

A pass is an independent estimate of every pixel, so the spread of passes is their error. Pass k of
a seed is always the same one: a picture that is interrupted and continued is the one that would
have been.

Input  : what adds a pass.    Output : sums over passes, and how well their mean is known.
Cost   : 1 ms a pass for 100,000 pixels.
Fails  : fewer than `LEAST_PASSES` tell too little about their spread.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from render.reference.passes import Sums
from render.reference.pixel_rays import SIDE

LEAST_PASSES = 4
"""Fewer tell too little about their spread."""

AddPass = Callable[[int, int, Sums], None]
"""Adds pass `number` to sums, with `factor` times the rays of the first one."""

_PASSES = 8  # that are aimed at
_LONGEST_PASS_S = 10.0  # what an interruption may cost
_LEAST_POWER = 1e-6  # of a picture, in that of its noise


@dataclass(eq=False)
class Progress:
    """How far a picture is; `accumulate` goes on from it.

    Attributes
    ----------
    sums : Sums
        Over the passes that count.
    passes : int
        How many these are.
    drawn : int
        Passes ever begun: those before the last change of `factor` no longer count.
    factor : int
        By how much a pass has more rays than the first, a power of two.
    elapsed_s, pass_s : float
        Spent so far, and on the last pass.
    relative_error : float
        Root mean square of the standard error over that of the picture; infinite until there are
        `LEAST_PASSES`, and where nothing of the picture stands out of its noise.
    may_grow : bool
        Whether it is still open how many rays a pass should have.
    memory : dict of arrays
        What those who add passes have learned from them, by the number of samples.
    """

    sums: Sums
    passes: int = 0
    drawn: int = 0
    factor: int = 1
    elapsed_s: float = 0.0
    pass_s: float = 0.0
    relative_error: float = math.inf
    may_grow: bool = True
    memory: dict[int, NDArray[np.float64]] = field(default_factory=dict)


def nothing_yet(size_px: tuple[int, int]) -> Progress:
    """Return the progress of a picture of a width and height, before its first pass."""
    return Progress(_no_sums(size_px[1], size_px[0]))


def accumulate(
    add: AddPass,
    progress: Progress,
    *,
    error: float,
    seconds: float = math.inf,
    most_factor: int = 1,
    on_pass: Callable[[Progress], None] | None = None,
) -> None:
    """Add passes until the relative error is `error` or the seconds are over.

    If far more passes were needed than tell their spread, they begin anew with more rays each, up
    to `most_factor` times as many: those of one pass err less together than those of many. But none
    should take longer than some seconds, for it is lost when it is interrupted.

    Parameters
    ----------
    add : callable
    progress : Progress
        Is changed: what it holds counts.
    error : float
        Relative error to stop at, 0 for none.
    seconds : float
        Time to stop before, but not before there are `LEAST_PASSES`.
    most_factor : int
        1 if passes must stay as they are.
    on_pass : callable or None
        Told the progress after each pass.
    """
    while not _is_done(progress, error, seconds):
        _grow(progress, error, seconds, most_factor)
        start = time.perf_counter()
        add(progress.drawn, progress.factor, progress.sums)
        progress.drawn += 1
        progress.passes += 1
        if progress.passes >= LEAST_PASSES:
            progress.relative_error = _relative_error(progress)
        progress.pass_s = time.perf_counter() - start
        progress.elapsed_s += progress.pass_s
        if on_pass is not None:
            on_pass(progress)


def mean_and_variance(progress: Progress) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean over passes (H, W, 4), and its variance (H, W, 3)."""
    sums, passes = progress.sums, progress.passes
    mean = sums.radiance / passes
    spread = np.maximum(sums.squares[..., :3] / passes - mean[..., :3] ** 2, 0.0)
    return mean, spread / (passes - 1)


def _is_done(progress: Progress, error: float, seconds: float) -> bool:
    if progress.passes < LEAST_PASSES:
        return False
    return progress.relative_error <= error or progress.elapsed_s + progress.pass_s > seconds


def _grow(progress: Progress, error: float, seconds: float, most_factor: int) -> None:
    """Begin anew with more rays a pass, once, when the first passes tell that it pays."""
    if not progress.may_grow or progress.passes < LEAST_PASSES:
        return
    progress.may_grow = False
    wanted = LEAST_PASSES * (progress.relative_error / error) ** 2 if error else math.inf
    affordable = (seconds - progress.elapsed_s) / progress.pass_s
    larger = min(wanted, affordable) / _PASSES
    most = min(most_factor, _LONGEST_PASS_S / progress.pass_s)
    progress.factor = 2 ** int(math.log2(max(min(larger, most), 1)))
    if progress.factor > 1:
        progress.sums = _no_sums(*progress.sums.radiance.shape[:2])
        progress.passes = 0
        progress.relative_error = math.inf


def _relative_error(progress: Progress) -> float:
    mean, variance = mean_and_variance(progress)
    # The picture's square has its own error in it.
    power, noise = float(np.mean(mean[..., :3] ** 2 - variance)), float(variance.mean())
    if noise == 0:
        return 0.0
    return math.sqrt(noise / power) if power > noise * _LEAST_POWER else math.inf


def _no_sums(height: int, width: int) -> Sums:
    return Sums(
        np.zeros((height, width, 4)),
        np.zeros((height, width, 4)),
        np.zeros(-(-height // SIDE), np.int64),
    )
