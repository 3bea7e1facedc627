"""Our response: a plausible curve plus corrections, as many as predict patches it did not see.

Domain : log g(z), z a mean count; g(z_ik) = E_i · signal_k for patch i and exposure k.
Input  : Samples.    Output : Curve with its standard deviation, and corrected exposures.
Cost   : 0.5 s for 3,000 patches at 5 exposures.
Fails  : counts that no patch has, and a ripple with the exposures' common ratio, follow from what
         tone curves look like (calibration.response_family); the deviation says how far that holds
         for such curves. An error of the labels that grows with the exposure's logarithm is a power
         of the curve: a tolerance frees the exposures only about their trend, by at most twice
         itself, and the deviation holds what the trend may be off.

Unknowns are the same number of coefficients for each channel and, given a tolerance, one correction
for each exposure; the E_i are eliminated. Every coefficient has the variance that the family gives
it, so the result is the most probable curve, among those that rise at every count. Patches are
weighted by their noise on the curve, and down where they disagree (Cauchy), so that a few that
moved or rang cannot bend it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from calibration.response_bound import least_step
from calibration.response_curve import COUNTS, MIDDLE_COUNT, Curve, scaled
from calibration.response_family import COMPONENTS, curve_family
from calibration.response_samples import MOST_COUNT, ROUNDING_DN2, Samples

_FOLDS = 8
_ROUNDS = 6
_FEWEST_COMPONENTS = 3
_WIDENING = 2.0
"""Standard deviation of a coefficient over that in the family, which cannot hold every camera."""
_OUTLIER = 3.0
_LEAST_DEVIATION = 0.0003
"""Of log g over its value at the middle count: what the second order of `_shaded` leaves."""
_LEAST_SLOPE = 1e-4
_BELIEVED = 1e8
"""Precision of what is taken for certain: the exposures' mean and trend."""


@dataclass(frozen=True)
class _Problem:
    """Samples ready for the fit: everything that does not change from round to round.

    `mean` (N, K, 3) and `basis` (N, K, 3, M), the family at the patches' counts, 0 where they are
    not `used` (N, K, 3).
    """

    samples: Samples
    mean: NDArray[np.float64]
    basis: NDArray[np.float64]
    used: NDArray[np.bool_]

    @property
    def correction_count(self) -> int:
        """Corrections of exposures among the unknowns: none if the labels are believed."""
        return len(self.samples.log_signal) if self.samples.tolerance > 0 else 0


def fit_monotone(samples: Samples) -> Curve:
    """Return the curve, its deviation, and the corrections of the exposures."""
    problem = _problem(samples)
    unknowns = np.zeros(3 * COMPONENTS + problem.correction_count)
    for _ in range(_ROUNDS):
        shaded = _shaded(problem, unknowns)
        weights = _weights(shaded, unknowns)
        normals = _normal_equations(shaded, weights)
        count = _cross_validated(normals, problem)
        unknowns, covariance = _solve(normals.sum(axis=0), problem, count)
        unknowns = _admissible(unknowns, covariance, problem)
    # What the left-out components could still change belongs to the uncertainty.
    _, covariance = _solve(normals.sum(axis=0), problem, COMPONENTS)
    return _curve(unknowns, covariance, problem, _lack_of_fit(shaded, unknowns, weights))


def _problem(samples: Samples) -> _Problem:
    used = np.isfinite(samples.counts)
    counts = np.where(used, samples.counts, MIDDLE_COUNT)
    mean, components = curve_family()
    return _Problem(
        samples,
        CubicSpline(COUNTS, mean)(counts) * used,
        CubicSpline(COUNTS, components)(counts) * used[..., None],
        used,
    )


def _shaded(problem: _Problem, unknowns: NDArray[np.float64]) -> _Problem:
    """Return the problem with the logarithm of the mean of g over a patch, not of its mean count.

    To second order they differ by log(1 + ½ (g″/g) s²), s² the variance of the counts before they
    were rounded, and g″/g = (log g)″ + (log g)′².
    """
    slope = np.gradient(_log_table(unknowns), axis=0)
    bend = np.gradient(slope, axis=0) + slope**2
    spread = np.maximum(np.nan_to_num(problem.samples.spread) - ROUNDING_DN2, 0.0)
    shading = np.log1p(np.maximum(0.5 * _at_counts(problem, bend) * spread, -0.5))
    return replace(problem, mean=problem.mean + shading * problem.used)


def _at_counts(problem: _Problem, table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a table (256, 3) interpolated at the patches' counts, (N, K, 3)."""
    counts = np.where(problem.used, problem.samples.counts, MIDDLE_COUNT)
    return np.stack([np.interp(counts[..., c], COUNTS, table[:, c]) for c in range(3)], axis=-1)


def _log_table(unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return log g of every count, (256, 3)."""
    mean, components = curve_family()
    return mean[:, None] + components @ unknowns[: 3 * COMPONENTS].reshape(3, COMPONENTS).T


def _centred(values: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values (N, K, …) less their weighted mean over each patch's exposures."""
    total = np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    return values - (weights * values).sum(axis=1, keepdims=True) / total


def _weights(problem: _Problem, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return inverse variances of log g, (N, K, 3), in units in which residuals are 1.

    The noise that counts have on the curve is scaled to what the residuals say, which holds
    whatever the camera's processing did to it.
    """
    slope = np.gradient(_log_table(unknowns), axis=0)
    with np.errstate(invalid="ignore"):
        noise = np.maximum(_at_counts(problem, slope), _LEAST_SLOPE) ** 2 * problem.samples.variance
    plain = np.where(problem.used, 1.0 / noise, 0.0)
    residuals = _residuals(problem, unknowns, plain)
    # What a patch's own mean leaves of an exposure's error: the more weight, the less.
    share = 1.0 - plain / np.maximum(plain.sum(axis=1, keepdims=True), 1e-300)
    squared = residuals**2 * plain / np.maximum(share, 1e-3)
    median_of_chi_squared = 0.4549
    scale = float(np.median(squared[problem.used & (share > 0.05)])) / median_of_chi_squared
    return plain / scale / (1.0 + squared / (scale * _OUTLIER**2))


def _residuals(
    problem: _Problem, unknowns: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return log g − log signal − log E, (N, K, 3), E from the patch's exposures together."""
    coefficients = unknowns[: 3 * COMPONENTS].reshape(3, COMPONENTS)
    values = problem.mean + np.einsum("nkcm,cm->nkc", problem.basis, coefficients)
    exposure = problem.samples.log_signal.copy()
    if problem.correction_count:
        exposure += unknowns[3 * COMPONENTS :]
    return _centred(values - exposure[:, None], weights)


def _lack_of_fit(
    problem: _Problem, unknowns: NDArray[np.float64], weights: NDArray[np.float64]
) -> float:
    """Return the standard deviation of log g that no number of patches takes away.

    Residuals are averaged by exposure, channel and count, in bins of 16: their scatter beyond
    chance is what one curve cannot explain, such as a camera that changes it between exposures.
    """
    residuals = _residuals(problem, unknowns, weights)
    counts = np.where(problem.used, problem.samples.counts, 0.0).astype(int) // 16
    exposure = np.arange(residuals.shape[1])[:, None]
    bins: NDArray[np.intp] = ((exposure * 3 + np.arange(3)) * 16 + counts)[problem.used]
    w = weights[problem.used]
    total = np.bincount(bins, w)
    seen = total > 0
    mean = np.bincount(bins, w * residuals[problem.used])[seen] / total[seen]
    return float(np.sqrt(max(0.0, float(np.mean(mean**2 - 1.0 / total[seen])))))


def _normal_equations(problem: _Problem, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return XᵀWX of each fold, with the right side as its last row and column, (F, U + 1, U + 1).

    Taking each patch's weighted mean over its exposures out of the columns eliminates its radiance.
    """
    patches, exposures = problem.used.shape[:2]
    free = problem.correction_count
    size = 3 * COMPONENTS + free + 1
    normals = np.zeros((_FOLDS, size, size))
    fold = np.arange(patches) % _FOLDS
    correction = np.broadcast_to(-np.eye(exposures)[:, :free], (patches, exposures, free))
    for channel in range(3):
        target = problem.samples.log_signal - problem.mean[:, :, channel]
        columns = np.concatenate(
            [problem.basis[:, :, channel], correction, target[..., None]], axis=2
        )
        w = weights[:, :, channel, None]
        columns = _centred(columns, w) * np.sqrt(w)
        own = np.arange(COMPONENTS) + channel * COMPONENTS
        place = np.concatenate([own, np.arange(3 * COMPONENTS, size)])
        for f in range(_FOLDS):
            rows = columns[fold == f].reshape(-1, len(place))
            normals[f][np.ix_(place, place)] += rows.T @ rows
    return normals


def _solve(
    normal: NDArray[np.float64], problem: _Problem, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the most probable unknowns and their covariance, with `count` components a channel.

    The other components are 0, and the curves may fall.
    """
    size = len(normal) - 1
    precision = np.zeros((size, size))
    np.fill_diagonal(precision[: 3 * COMPONENTS], _WIDENING**-2)
    if problem.correction_count:
        trend = np.stack([np.ones(problem.correction_count), _centred_signal(problem)])
        precision[3 * COMPONENTS :, 3 * COMPONENTS :] = (
            np.eye(problem.correction_count) / problem.samples.tolerance**2
            + _BELIEVED * trend.T @ trend
        )
    kept = np.ones(size, np.bool_)
    kept[: 3 * COMPONENTS] = np.tile(np.arange(COMPONENTS) < count, 3)
    hessian = (normal[:-1, :-1] + precision)[np.ix_(kept, kept)]
    unknowns, covariance = np.zeros(size), np.zeros((size, size))
    covariance[np.ix_(kept, kept)] = np.linalg.inv(hessian)
    unknowns[kept] = np.linalg.solve(hessian, normal[:-1, -1][kept])
    return unknowns, covariance


def _admissible(
    unknowns: NDArray[np.float64], covariance: NDArray[np.float64], problem: _Problem
) -> NDArray[np.float64]:
    """Return the most probable unknowns whose curves rise from every count to the next.

    Corrections stay within two tolerances.
    """
    free = problem.correction_count
    _, components = curve_family()
    rise = np.kron(np.eye(3), np.diff(components, axis=0))
    bound = np.zeros((len(rise) + 2 * free, len(unknowns)))
    bound[: len(rise), : 3 * COMPONENTS] = rise
    bound[len(rise) :, 3 * COMPONENTS :] = np.vstack([np.eye(free), -np.eye(free)])
    slope = np.diff(_log_table(unknowns), axis=0)
    corrections = unknowns[3 * COMPONENTS :]
    most = 2.0 * problem.samples.tolerance
    missing = np.concatenate(
        [_LEAST_SLOPE - slope.T.ravel(), -most - corrections, corrections - most]
    )
    if (missing <= 0).all():
        return unknowns
    return unknowns + least_step(covariance, bound, missing)


def _cross_validated(normals: NDArray[np.float64], problem: _Problem) -> int:
    """Return the fewest components whose error on held-out patches is the least but for chance.

    Chance is one standard error over the folds. Fewer are smoother, and a ripple that the patches
    cannot see is never preferred for the noise that it happens to fit.
    """
    together = normals.sum(axis=0)
    counts = range(_FEWEST_COMPONENTS, COMPONENTS + 1)
    errors = np.empty((len(counts), _FOLDS))
    for row, count in enumerate(counts):
        for fold, held_out in enumerate(normals):
            unknowns, _ = _solve(together - held_out, problem, count)
            extended = np.append(unknowns, -1.0)
            errors[row, fold] = extended @ held_out @ extended
    total = errors.sum(axis=1)
    best = int(np.argmin(total))
    excess = errors - errors[best]
    chance = excess.std(axis=1, ddof=1) * np.sqrt(_FOLDS)
    return counts[int(np.argmax(total - total[best] <= chance))]


def _centred_signal(problem: _Problem) -> NDArray[np.float64]:
    return problem.samples.log_signal - problem.samples.log_signal.mean()


def _curve(
    unknowns: NDArray[np.float64],
    covariance: NDArray[np.float64],
    problem: _Problem,
    lack_of_fit: float,
) -> Curve:
    log_values = _log_table(unknowns)
    values = scaled(np.exp(log_values))
    _, components = curve_family()
    relative = components - components[MIDDLE_COUNT]
    log_variance = np.stack(
        [
            np.einsum("zm,mn,zn->z", relative, covariance[own, own], relative)
            for own in (slice(COMPONENTS * c, COMPONENTS * (c + 1)) for c in range(3))
        ],
        axis=-1,
    )
    least = max(lack_of_fit, _LEAST_DEVIATION)
    if problem.correction_count:
        trend = problem.samples.tolerance / np.linalg.norm(_centred_signal(problem))
        log_variance += ((log_values - log_values[MIDDLE_COUNT]) * trend) ** 2
    deviation = values * np.sqrt(np.maximum(log_variance, 0.0) + least**2)
    deviation[[0, MIDDLE_COUNT]] = 0.0
    deviation[MOST_COUNT + 1 :] = 0.0
    correction = np.zeros(len(problem.samples.log_signal))
    if problem.correction_count:
        correction = unknowns[3 * COMPONENTS :] / np.log(2)
    return Curve(values, deviation, correction)
