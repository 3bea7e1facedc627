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

from calibration.lens.adjust import Free, Solution
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
    free : Free
        What was sought besides the poses.
    held_out_px : float
        Rms error at corners that it was not fitted to, wrong ones counted at their limit.
    excess_px, excess_error_px : float
        By how much that is more than the best lens's, in the mean over the views, and the standard
        error of that.
    """

    candidate: Candidate
    fit: Fit
    free: Free
    held_out_px: float
    excess_px: float
    excess_error_px: float

    @property
    def parameter_count(self) -> int:
        """How many numbers were fitted that all views share."""
        return self.free.count

    @property
    def plausible(self) -> bool:
        """Whether it predicts no worse than the best, as far as these views tell."""
        return self.excess_px <= self.excess_error_px


def try_lenses(corners: Corners, reference: Fit, rim_angle_rad: float) -> tuple[Trial, ...]:
    """Return the lenses tried, fewest parameters first.

    The reference is a Kannala-Brandt lens with fx and fy; with such lenses it is decided first how
    warped the board is, whether pixels are square, and whether the entrance pupil moves.
    """
    model = reference.solution.model
    assert isinstance(model, KannalaBrandt)
    one_focal = replace(model, focal_px=float(np.mean(model.focal_px)))
    square, oblong = (Candidate(each.name, each, _all(each)) for each in (one_focal, model))

    def decided(lenses: list[tuple[Candidate, Free]]) -> Trial:
        return chosen(_compared(corners, reference, lenses))

    degree = decided([(oblong, Free(oblong.free, degree)) for degree in (0, 2, 4)]).free.warp_degree
    lens = decided([(each, Free(each.free, degree)) for each in (square, oblong)]).candidate
    form = decided([(lens, Free(lens.free, degree, pupil)) for pupil in (False, True)])
    reached = form.fit.solution.model
    rest = [
        (each, Free(each.free, degree, form.free.pupil))
        for each in candidates(reached, rim_angle_rad, square=lens is square)
    ]
    return _compared(corners, form.fit, rest)


def _all(model: KannalaBrandt) -> NDArray[np.bool_]:
    return np.ones(len(parameters(model)), np.bool_)


def chosen(trials: tuple[Trial, ...]) -> Trial:
    """Return the simplest plausible lens; of equally simple ones the one that predicts best."""
    plausible = [trial for trial in trials if trial.plausible]
    return min(plausible, key=lambda trial: (trial.parameter_count, trial.held_out_px))


def _compared(
    corners: Corners, reference: Fit, lenses: list[tuple[Candidate, Free]]
) -> tuple[Trial, ...]:
    folds = min(_MOST_FOLDS, corners.view_count)
    fits, errors = [], []
    for candidate, free in lenses:
        solution = reference.solution
        start = Solution(
            candidate.model,
            solution.poses,
            np.where(free.warp, solution.warp_m, 0.0),
            solution.pupil_m if free.pupil else 0.0,
        )
        fit = fit_robustly(corners, start, free)
        fits.append(fit)
        residuals = cross_validated_px(corners, fit, free, folds)
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
            free,
            float(np.sqrt(capped[i].mean())),
            float(excess[i].mean()),
            float(standard_error[i]),
        )
        for i, ((candidate, free), fit) in enumerate(zip(lenses, fits, strict=True))
    ]
    return tuple(sorted(trials, key=lambda trial: trial.parameter_count))
