"""How much less light a lens passes away from its axis, from samples that share a light each.

Domain : one lens, one aperture and focus: vignetting differs from stop to stop.
Input  : Samples: angles, and what was measured there of lights whose strength is not known.
Output : VignettingFit: coefficients for the Calibration, and how uncertain V(θ) is.
Of polynomials in θ², alone and with terms that differ around the axis, the one with the fewest
coefficients is taken that predicts left-out samples as well as any does (the one-standard-error
rule of L. Breiman, J. Friedman, R. Olshen, C. Stone, "Classification and Regression Trees", 1984).
Outliers (dust, edges, what moved) are weighed down by a Cauchy weight.
Cost   : 1 s for 3000 samples.
Fails  : where no sample lies V is extrapolated; and a response that is wrong by a power γ makes
V^γ, which no single light can tell.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.camera import uneven_terms
from capture.errors import InputError

Array = NDArray[np.float64]

_MOST_RADIAL = 3
_FOLDS = 10
_CAUCHY_SIGMAS = 2.385
"""Outliers weigh less from here on; 95 % efficient for normal errors."""
_CAP_SIGMAS = 4.0
_SIGNIFICANT_SIGMAS = 2.0
"""Standard errors, and not one as in the rule's source: a dozen forms are compared."""
_MOST_HELD_OUT = 0.1
_LEAST_V = 0.02
"""No step of the fit makes V darker anywhere: the logarithm is of positive numbers."""
_ROUNDS = 60
_SETTLED_SIGMAS = 1e-3
_SMALLEST_SIGMA = 1e-7
"""Of log V: below, samples without noise would be all outliers."""


@dataclass(frozen=True, eq=False)
class Samples:
    """What was measured through the lens.

    Attributes
    ----------
    angle_rad, azimuth_rad : (n,) float64
        Where, from the axis, and from the camera's +x toward its +y.
    log_value : (n,) float64
        Logarithm of the radiance or flux, vignetting not divided out.
    light : (n,) int64
        Which light was measured, from 0: samples of one differ by vignetting alone.
    block : (n,) int64
        Which samples may share an error, such as neighbours. They are left out together.
    tells_unevenness : bool
        Whether they tell a lens that differs around its axis from a light that does.
    """

    angle_rad: Array
    azimuth_rad: Array
    log_value: Array
    light: NDArray[np.int64]
    block: NDArray[np.int64]
    tells_unevenness: bool


@dataclass(frozen=True)
class Trial:
    """One form of V(θ, φ), fitted to all samples, and its rms error at left-out ones.

    `held_out` is of log V, so a share; samples off by more than four standard deviations count as
    four. `is_plausible` says that it is not significantly worse than the best form.
    """

    radial: tuple[float, ...]
    uneven: tuple[float, ...]
    held_out: float
    is_plausible: bool

    @property
    def count(self) -> int:
        """How many coefficients it has."""
        return len(self.radial) + len(self.uneven)

    def illumination(self, angle_rad: Array, azimuth_rad: Array) -> Array:
        """Return V at these angles."""
        terms = _terms(angle_rad, azimuth_rad, len(self.radial), len(self.uneven))
        return np.asarray(1 + terms @ np.array([*self.radial, *self.uneven]))


@dataclass(frozen=True, eq=False)
class VignettingFit:
    """The vignetting of a lens and how well it is known.

    Attributes
    ----------
    chosen : Trial
        Its `radial` and `uneven` are Calibration.vignetting and .uneven_vignetting.
    covariance : (k, k) float64
        Of both, in that order.
    seen_rad : (float, float)
        Least and greatest angle of the samples.
    sample_count : int
    trials : tuple of Trial
        Fewest coefficients first.
    """

    chosen: Trial
    covariance: Array
    seen_rad: tuple[float, float]
    sample_count: int
    trials: tuple[Trial, ...]

    def deviation(self, angle_rad: Array, azimuth_rad: Array | float = 0.0) -> Array:
        """Return the standard deviation of V at these angles.

        From the samples' scatter, and from how far the other plausible forms lie from the chosen.
        """
        angle, azimuth = np.broadcast_arrays(np.asarray(angle_rad, np.float64), azimuth_rad)
        terms = _terms(angle, azimuth, len(self.chosen.radial), len(self.chosen.uneven))
        scatter = np.einsum("...i,ij,...j", terms, self.covariance, terms)
        others = [
            each.illumination(angle, azimuth) - self.chosen.illumination(angle, azimuth)
            for each in self.trials
            if each.is_plausible
        ]
        return np.sqrt(scatter + np.square(others).max(axis=0))


def fit_vignetting(samples: Samples) -> VignettingFit:
    """Return the vignetting that explains the samples with the fewest coefficients.

    Raises
    ------
    InputError
        If the samples are too few or span too small a range of angles to tell, or differ from any
        lens's vignetting by more than a tenth.
    """
    blocks = np.unique(samples.block).size
    span = float(np.ptp(samples.angle_rad)) if samples.angle_rad.size else 0.0
    if blocks < _FOLDS or span < np.radians(10):
        raise InputError(
            f"vignetting needs {_FOLDS} measurements or more that are spread from the axis to "
            f"the rim; got {blocks} over {np.degrees(span):.0f}°"
        )
    forms = [
        (radial, uneven)
        for radial in range(_MOST_RADIAL + 1)
        for uneven in ((0, 2, 4) if samples.tells_unevenness else (0,))
        if 2 * (radial + uneven) <= blocks
    ]
    forms.sort(key=sum)
    trials = _compared(samples, forms)
    chosen = min(
        (each for each in trials if each.is_plausible),
        key=lambda each: (each.count, each.held_out),
    )
    if chosen.held_out > _MOST_HELD_OUT:
        raise InputError(
            f"the measurements differ by {chosen.held_out:.0%} from what any vignetting makes of "
            "light that is the same in all pictures; do they show that, and are the calibrations "
            "theirs?"
        )
    return VignettingFit(
        chosen=chosen,
        covariance=_covariance(samples, chosen),
        seen_rad=(float(samples.angle_rad.min()), float(samples.angle_rad.max())),
        sample_count=samples.angle_rad.size,
        trials=trials,
    )


def _terms(angle: Array, azimuth: Array, radial_count: int, uneven_count: int) -> Array:
    """Return what the coefficients multiply, (..., radial_count + uneven_count)."""
    radial = (angle**2)[..., None] ** np.arange(1, radial_count + 1)
    return np.concatenate([radial, uneven_terms(angle, azimuth, uneven_count)], axis=-1)


def _compared(samples: Samples, forms: list[tuple[int, int]]) -> tuple[Trial, ...]:
    blocks, block = np.unique(samples.block, return_inverse=True)
    fold = np.random.default_rng(0).permutation(blocks.size) % _FOLDS
    errors = np.empty((len(forms), samples.angle_rad.size))
    coefficients = []
    for i, form in enumerate(forms):
        terms = _terms(samples.angle_rad, samples.azimuth_rad, *form)
        everywhere = np.ones(len(terms), np.bool_)
        whole, _ = _fit(samples, terms, everywhere, np.zeros(terms.shape[1]))
        coefficients.append(whole.tolist())
        for k in range(_FOLDS):
            held = fold[block] == k
            fitted, weights = _fit(samples, terms, ~held, whole)
            # A light that only held-out samples show has its strength from them.
            weights[held & ~np.isin(samples.light, samples.light[~held])] = 1.0
            errors[i, held] = _residuals(samples, terms, fitted, weights)[held]
    # A wrong sample says nothing about the lens: beyond the limit all forms are equally wrong.
    limit = _CAP_SIGMAS * min(_spread(each) for each in errors)
    squares = np.minimum(np.abs(errors), limit) ** 2
    by_block = np.array([np.bincount(block, each) for each in squares]) / np.bincount(block)
    best = int(np.argmin(by_block.mean(axis=1)))
    excess = by_block - by_block[best]
    standard_error = excess.std(axis=1, ddof=1) / np.sqrt(blocks.size)
    plausible = excess.mean(axis=1) <= _SIGNIFICANT_SIGMAS * standard_error
    return tuple(
        Trial(
            tuple(coefficients[i][:radial]),
            tuple(coefficients[i][radial:]),
            float(np.sqrt(squares[i].mean())),
            bool(plausible[i]),
        )
        for i, (radial, _) in enumerate(forms)
    )


def _fit(
    samples: Samples, terms: Array, used: NDArray[np.bool_], start: Array
) -> tuple[Array, Array]:
    """Return the coefficients (k,) of 1 + terms · coefficients, and the samples' weights (n,).

    Gauss-Newton on log V, each light's strength eliminated; reweighed in every round. Samples that
    are not used have the weight 0.
    """
    coefficients = start
    weights = used.astype(np.float64)
    for _ in range(_ROUNDS):
        residuals = _residuals(samples, terms, coefficients, weights)
        sigma = _spread(residuals[used])
        weights = used / (1 + (residuals / (_CAUCHY_SIGMAS * sigma)) ** 2)
        residuals = _residuals(samples, terms, coefficients, weights)
        slopes = _slopes(samples, terms, coefficients, weights)
        root = np.sqrt(weights)
        step = np.linalg.lstsq(root[:, None] * slopes, root * residuals, rcond=None)[0]
        while np.any(1 + terms @ (coefficients + step) < _LEAST_V):
            step /= 2
        coefficients = coefficients + step
        if np.abs(terms @ step).max(initial=0) < _SETTLED_SIGMAS * sigma:
            break
    return coefficients, weights


def _residuals(samples: Samples, terms: Array, coefficients: Array, weights: Array) -> Array:
    return _centred(samples.log_value - np.log(1 + terms @ coefficients), samples.light, weights)


def _slopes(samples: Samples, terms: Array, coefficients: Array, weights: Array) -> Array:
    slopes = terms / (1 + terms @ coefficients)[:, None]
    columns = [_centred(column, samples.light, weights) for column in slopes.T]
    return np.stack(columns, axis=1) if columns else slopes


def _centred(values: Array, light: NDArray[np.int64], weights: Array) -> Array:
    """Return values less the weighted mean over their light: its strength is not known."""
    total = np.bincount(light, weights)
    mean = np.bincount(light, weights * values) / np.where(total > 0, total, 1.0)
    return np.asarray(values - mean[light])


def _spread(residuals: Array) -> float:
    """Return a standard deviation that outliers do not move."""
    return max(1.4826 * float(np.median(np.abs(residuals))), _SMALLEST_SIGMA)


def _covariance(samples: Samples, chosen: Trial) -> Array:
    """Return the coefficients' covariance (k, k), errors being independent from block to block.

    The sandwich estimate: neighbours that err alike make it larger, as they should.
    """
    count = len(chosen.radial), len(chosen.uneven)
    terms = _terms(samples.angle_rad, samples.azimuth_rad, *count)
    start = np.array([*chosen.radial, *chosen.uneven])
    coefficients, weights = _fit(samples, terms, np.ones(len(terms), np.bool_), start)
    slopes = _slopes(samples, terms, coefficients, weights)
    residuals = _residuals(samples, terms, coefficients, weights)
    blocks, block = np.unique(samples.block, return_inverse=True)
    inverse = np.linalg.pinv(slopes.T @ (weights[:, None] * slopes))
    pulls = np.zeros((blocks.size, chosen.count))
    np.add.at(pulls, block, (weights * residuals)[:, None] * slopes)
    freedom = blocks.size / max(blocks.size - chosen.count - 1, 1)
    return np.asarray(freedom * inverse @ (pulls.T @ pulls) @ inverse)
