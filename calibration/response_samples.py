"""What a response is estimated from: small smooth patches, seen at several exposures.

Input  : brackets of 8-bit counts.    Output : Samples, mean counts of patches.
Cost   : independent of the picture's size: at most 192 × 192 patches of each frame are read.
Fails  : where nothing in the scene is smooth over eight pixels; and a fault that all patches share,
         such as flicker of the light between the exposures, looks like the response.

The mean of a patch has an eighth of a pixel's noise and hardly a count's rounding, does not care
about a camera that moved by a pixel, and is not near an edge where JPEG rings. Patches lie on the
blocks of JPEG.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.frame import Bracket, Frame

LEAST_COUNT, MOST_COUNT = 5.0, 250
"""Mean of a patch, and largest count in it, to which it tells about the response: below, noise was
cut off at black; above, some pixels are full and JPEG has brought them back."""

_PATCH_PX = 8
_PATCHES_PER_SIDE = 192
_STRATA, _PATCHES_PER_STRATUM = 64, 64
_ROUGHNESS = 0.2
"""Standard deviation within a patch over its mean, above which it holds an edge, or more noise than
light."""
_LEAST_DEVIATION_DN = 0.3
"""Standard deviation of a patch's mean that no averaging takes away: JPEG's rounding of blocks."""
ROUNDING_DN2 = 1 / 12
_LEAST_STEP_EV, _WIDEST_STEP_EV = 0.3, 3.5
"""What two exposures must be apart to tell anything, and may be to determine the curve between."""
_FEWEST_PATCHES = 200
_COVERED_COUNTS = (16, 240)
_WIDEST_GAP = 80
_FEWEST_IN_BIN = 4


@dataclass(frozen=True)
class Samples:
    """N patches at K exposures.

    Attributes
    ----------
    counts : (N, K, 3) float64
        Mean counts in DN; NaN where a patch is too dark, has a full pixel or holds an edge.
    spread : (N, K, 3) float64
        Variance of the counts within the patch, in DN².
    log_signal : (K,) float64
        Natural logarithm of the labelled Exposure.signal, rising.
    tolerance : float
        Standard deviation of the labels, in natural logarithm; 0 believes them.
    """

    counts: NDArray[np.float64]
    spread: NDArray[np.float64]
    log_signal: NDArray[np.float64]
    tolerance: float = 0.0

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def variance(self) -> NDArray[np.float64]:
        """Of the mean counts, in DN², (N, K, 3)."""
        return (self.spread + ROUNDING_DN2) / _PATCH_PX**2 + _LEAST_DEVIATION_DN**2

    def subset(self, chosen: NDArray[np.bool_]) -> "Samples":
        """Return the patches chosen by (N,) bool."""
        return replace(self, counts=self.counts[chosen], spread=self.spread[chosen])


def sample_brackets(brackets: Sequence[Bracket], exposure_tolerance_ev: float = 0.0) -> Samples:
    """Return the smoothest patches of the brackets, spread evenly over all counts.

    Parameters
    ----------
    brackets : sequence of Bracket
        Of one camera, 8 bits. Their exposures may differ from bracket to bracket.
    exposure_tolerance_ev : float
        Standard deviation of the exposures' labels, in stops.

    Raises
    ------
    InputError
        If the counts are not of 8 bits, or the brackets do not determine a response: exposures too
        alike or too far apart, too few patches seen in two of them, or counts that were never seen.
    """
    frames = [frame for bracket in brackets for frame in bracket.frames]
    if any(frame.counts.dtype != np.uint8 for frame in frames):
        raise InputError(
            f"a response is estimated from 8-bit counts, got {frames[0].counts.dtype}: these are "
            "linear as they come, and need none"
        )
    signals = sorted({float(f"{frame.exposure.signal:.6g}") for frame in frames})
    log_signal = np.log(signals)
    apart_ev = np.subtract.outer(log_signal, log_signal) / np.log(2)
    apart_ev = apart_ev[apart_ev >= _LEAST_STEP_EV]
    if not apart_ev.size:
        raise InputError(
            "the response needs brackets of two or more different exposures, best 1 to 3 EV apart; "
            f"got {', '.join(f'{signal:g} s' for signal in signals)}"
        )
    if apart_ev.min() > _WIDEST_STEP_EV:
        raise InputError(
            f"the exposures are {apart_ev.min():.1f} EV apart or more, which leaves the response "
            "between them open; take some that are 1 to 3 EV apart"
        )
    parts = [_patches(bracket, log_signal) for bracket in brackets]
    counts, spread, roughness = (np.concatenate(each) for each in zip(*parts, strict=True))
    chosen = _smoothest(counts, roughness)
    samples = Samples(
        counts[chosen], spread[chosen], log_signal, exposure_tolerance_ev * float(np.log(2))
    )
    _check_coverage(samples)
    return samples


def _patches(bracket: Bracket, log_signal: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return counts and spread (N, K, 3), and roughness (N,), of one bracket's patches.

    Of exposures that the bracket holds more than once, the last stands for all.
    """
    rows, columns = (
        np.unique(np.linspace(0, n - 1, min(n, _PATCHES_PER_SIDE)).astype(int))
        for n in (side // _PATCH_PX for side in bracket.frames[0].counts.shape[:2])
    )
    shape = (len(rows) * len(columns), len(log_signal), 3)
    counts, spread = np.full(shape, np.nan), np.full(shape, np.nan)
    for frame in bracket.frames:
        k = int(np.argmin(np.abs(log_signal - np.log(frame.exposure.signal))))
        mean, variance, top = _moments(frame, rows, columns)
        usable = (
            (mean >= LEAST_COUNT) & (top <= MOST_COUNT) & (variance <= (_ROUGHNESS * mean) ** 2)
        )
        counts[:, k] = np.where(usable, mean, np.nan)
        spread[:, k] = np.where(usable, variance, np.nan)
    counts[np.broadcast_to(np.isfinite(counts).sum(axis=1, keepdims=True) < 2, shape)] = np.nan
    some = np.isfinite(counts).any(axis=(1, 2))
    counts, spread = counts[some], spread[some]
    roughness = np.nanmax(np.sqrt(spread) / (counts + 10.0), axis=(1, 2))
    return counts, spread, roughness


def _moments(
    frame: Frame, rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]:
    """Return mean, variance and maximum of each patch of one frame, (N, 3) each."""
    height, width = (side // _PATCH_PX * _PATCH_PX for side in frame.counts.shape[:2])
    tiles = frame.counts[:height, :width].reshape(
        height // _PATCH_PX, _PATCH_PX, width // _PATCH_PX, _PATCH_PX, 3
    )
    tiles = tiles[rows][:, :, columns]
    values = tiles.astype(np.float32)
    mean, variance = values.mean(axis=(1, 3)), values.var(axis=(1, 3))
    return (
        mean.reshape(-1, 3).astype(np.float64),
        variance.reshape(-1, 3).astype(np.float64),
        tiles.max(axis=(1, 3)).reshape(-1, 3),
    )


def _smoothest(counts: NDArray[np.float64], roughness: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return which patches to keep: in each stratum of brightness those with the least roughness.

    A patch's brightness is its largest mean count, so that no scene is so dark or bright that its
    rare counts go missing.
    """
    if not len(counts):
        return np.empty(0, np.intp)
    brightest = np.nan_to_num(counts, nan=0.0).max(axis=(1, 2))
    stratum = (brightest * _STRATA / 256).astype(int)
    order = np.lexsort((roughness, stratum))
    first_of_stratum = np.searchsorted(stratum[order], stratum[order])
    return np.sort(order[np.arange(len(order)) - first_of_stratum < _PATCHES_PER_STRATUM])


def _check_coverage(samples: Samples) -> None:
    if len(samples) < _FEWEST_PATCHES:
        raise InputError(
            f"only {len(samples)} smooth patches are usable in two exposures, the response needs "
            f"{_FEWEST_PATCHES}: take exposures 1 to 3 EV apart of a still, varied scene"
        )
    low, high = _COVERED_COUNTS
    for channel, name in enumerate(("red", "green", "blue")):
        seen = samples.counts[..., channel]
        many = np.bincount(seen[np.isfinite(seen)].astype(int) // 4, minlength=64) >= _FEWEST_IN_BIN
        covered = np.concatenate([[low], 4 * np.flatnonzero(many) + 2, [high]])
        covered = covered[(covered >= low) & (covered <= high)]
        widest = int(np.argmax(np.diff(covered)))
        if covered[widest + 1] - covered[widest] > _WIDEST_GAP:
            raise InputError(
                f"no two exposures see {name} counts from {covered[widest]} to "
                f"{covered[widest + 1]}: the scene is too flat or the exposures too few to "
                "determine the response; take more exposures of a varied scene"
            )
