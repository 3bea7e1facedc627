"""The simplest lens that predicts new views no worse than the best one does.

Domain : lenses are compared by their errors at corners they were not fitted to, view by view.
Source : the one-standard-error rule of L. Breiman, J. Friedman, R. Olshen, C. Stone,
"Classification and Regression Trees", 1984, with the standard error of the paired difference
between two lenses.
Fails  : with few views the standard error is large and the choice simple; what the choice leaves
open is part of the uncertainty (uncertainty.py).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.lens.adjust import Solution
from calibration.lens.candidates import Candidate, candidates
from calibration.lens.corners import Corners
from calibration.lens.robust import OUTLIER_SIGMAS, Fit, fit_robustly
from calibration.lens.validation import cross_validated_px
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.parameters import parameters

Array = NDArray[np.float64]

_MOST_FOLDS = 5


@dataclass(frozen=True, eq=False)
class Trial:
    """A lens that was tried.

    Attributes
    ----------
    candidate : Candidate
    fit : Fit
        To all views.
    bend_free : bool
    held_out_px : float
        Rms error at corners that it was not fitted to, wrong ones counted at their limit.
    excess_px, excess_error_px : float
        By how much that is more than the best lens's, in the mean over the views, and the standard
        error of that.
    """

    candidate: Candidate
    fit: Fit
    bend_free: bool
    held_out_px: float
    excess_px: float
    excess_error_px: float

    @property
    def parameter_count(self) -> int:
        """How many numbers were fitted that all views share."""
        return int(self.candidate.free.sum()) + 2 * self.bend_free

    @property
    def plausible(self) -> bool:
        """Whether it predicts no worse than the best, as far as these views tell."""
        return self.excess_px <= self.excess_error_px


def try_lenses(corners: Corners, reference: Fit, rim_angle_rad: float) -> tuple[Trial, ...]:
    """Return the lenses tried, fewest parameters first.

    The reference is a Kannala-Brandt lens with fx and fy; by such lenses it is decided first
    whether pixels are square and the board is flat.
    """
    model = reference.solution.model
    assert isinstance(model, KannalaBrandt)
    square_model = replace(model, focal_px=float(np.mean(model.focal_px)))
    forms = [
        (Candidate(model.name, each, np.ones(len(parameters(each)), np.bool_)), bend_free)
        for each in (square_model, model)
        for bend_free in (False, True)
    ]
    form = chosen(_compared(corners, reference, forms))
    square = len(form.candidate.free) == len(parameters(square_model))
    rest = [
        (candidate, form.bend_free)
        for candidate in candidates(form.fit.solution.model, rim_angle_rad, square)
    ]
    return _compared(corners, form.fit, rest)


def chosen(trials: tuple[Trial, ...]) -> Trial:
    """Return the simplest plausible lens; of equally simple ones the one that predicts best."""
    plausible = [trial for trial in trials if trial.plausible]
    return min(plausible, key=lambda trial: (trial.parameter_count, trial.held_out_px))


def _compared(
    corners: Corners, reference: Fit, lenses: list[tuple[Candidate, bool]]
) -> tuple[Trial, ...]:
    folds = min(_MOST_FOLDS, corners.view_count)
    fits, errors = [], []
    for candidate, bend_free in lenses:
        start = Solution(candidate.model, reference.solution.poses, reference.solution.bend_m)
        if not bend_free:
            start = Solution(candidate.model, reference.solution.poses, np.zeros(2))
        fit = fit_robustly(corners, start, candidate.free, bend_free=bend_free)
        fits.append(fit)
        residuals = cross_validated_px(
            corners, fit.solution, candidate.free, bend_free=bend_free, folds=folds
        )
        errors.append(np.hypot(*residuals.T))
    # A wrong corner says nothing about the lens: beyond the limit all are equally wrong.
    limit = OUTLIER_SIGMAS * min(float(np.nanmedian(each)) for each in errors)
    capped = np.array([np.fmin(each, limit) for each in errors]) ** 2
    by_view = np.sqrt(
        [capped[:, corners.of_view(view)].mean(axis=1) for view in range(corners.view_count)]
    ).T
    best = int(np.argmin(by_view.mean(axis=1)))
    excess = by_view - by_view[best]
    standard_error = excess.std(axis=1, ddof=1) / np.sqrt(corners.view_count)
    trials = [
        Trial(
            candidate,
            fit,
            bend_free,
            float(np.sqrt(capped[i].mean())),
            float(excess[i].mean()),
            float(standard_error[i]),
        )
        for i, ((candidate, bend_free), fit) in enumerate(zip(lenses, fits, strict=True))
    ]
    return tuple(sorted(trials, key=lambda trial: trial.parameter_count))
