"""How far a calibrated lens is to be trusted: uncertainty by angle, and the valid angle.

Every lens that predicts new views as well as the best is possible. Were one of them the true one,
the chosen lens would be off by the difference and the noise of the fit; the mean square over them
is the uncertainty (a Bayesian model average with equal weights). Beyond the corners the possible
lenses part, and so the uncertainty grows there as it should.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.lens.choice import Trial
from calibration.lens.corners import Corners
from calibration.lens.robust import fit_robustly
from calibration.lens.uncertainty import (
    Fan,
    direction_covariance,
    direction_difference,
    fan,
    worst_sigma,
)

Array = NDArray[np.float64]

UNCERTAINTY_LIMIT_RAD = 3.5e-3
"""Beyond this standard deviation, 0.2°, rays are refused: it moves a shadow by 3.5 mm a metre."""


@dataclass(frozen=True, eq=False)
class Quality:
    """How sure the directions are, by the angle from the axis.

    Attributes
    ----------
    angle_rad : (A,) float64
        Rising, up to the last angle that the model or the picture has.
    sigma_rad : (A,) float64
        Standard deviation of a direction in the worst azimuth: the corners' noise carried through
        the fit, and what the choice of the model leaves open. Infinite where there is no direction.
    split_rad : (A,) float64
        Rms difference between lenses fitted to every other view; NaN where there is none.
    seen_rad : (float, float)
        Between which angles corners were seen.
    """

    angle_rad: Array
    sigma_rad: Array
    split_rad: Array
    seen_rad: tuple[float, float]


def assessed(
    corners: Corners,
    trials: tuple[Trial, ...],
    best: Trial,
    seen_rad: tuple[float, float],
    size_px: tuple[int, int],
) -> Quality:
    """Return how sure the best trial's lens is, from all that the corners leave possible."""
    model = best.fit.solution.model
    at = fan(seen_rad, _last_angle(model, size_px, seen_rad[1]))
    plausible = [trial for trial in trials if trial.plausible]
    possible = np.stack([_second_moment(trial, model, at) for trial in plausible])
    known = np.isfinite(possible)
    mean = np.where(known, possible, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    covariance = np.where(known.any(axis=0), mean, np.nan)
    odd, even = (
        _refitted(corners, best, np.arange(first, corners.view_count, 2)) for first in (0, 1)
    )
    split = direction_difference(odd, even, at)
    return Quality(
        at.angle_rad,
        worst_sigma(covariance),
        np.sqrt(np.sum(split**2, axis=-1).mean(axis=-1)),
        seen_rad,
    )


def _second_moment(trial: Trial, model: CameraModel, at: Fan) -> Array:
    """Return the mean square error (A, 16, 2, 2) of the model's directions if the trial is right.

    NaN where it has none.
    """
    own, free = trial.fit.solution.model, trial.candidate.free
    lens_count = trial.free.lens_count
    of_lens = trial.fit.covariance[:lens_count, :lens_count]
    apart = direction_difference(own, model, at)
    return direction_covariance(own, free, of_lens, at) + apart[..., :, None] * apart[..., None, :]


def _refitted(corners: Corners, trial: Trial, views: NDArray[np.int64]) -> CameraModel:
    """Return the trial's lens fitted to some of the views alone."""
    start = replace(trial.fit.solution, poses=trial.fit.solution.poses.views(views))
    return fit_robustly(corners.views(views), start, trial.free).solution.model


def _last_angle(model: CameraModel, size_px: tuple[int, int], outer_rad: float) -> float:
    """Return the largest angle that the picture's rim may show, or the model's limit."""
    width, height = size_px
    x, y = np.linspace(0, width - 1, 33), np.linspace(0, height - 1, 33)
    rim = np.concatenate(
        [np.stack(np.broadcast_arrays(x, row), -1) for row in (0.0, height - 1.0)]
        + [np.stack(np.broadcast_arrays(column, y), -1) for column in (0.0, width - 1.0)]
    )
    directions, seen = model.unproject(rim)
    angle = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])
    last = float(np.max(angle[seen], initial=0.0)) if seen.all() else model.limit_angle_rad
    return max(min(last, model.limit_angle_rad), outer_rad)


def valid_angle(quality: Quality) -> float:
    """Return the angle up to which corners were seen and directions are sure enough."""
    inner, outer = quality.seen_rad
    seen = (quality.angle_rad >= inner) & (quality.angle_rad <= outer)
    unsure = quality.angle_rad[seen & ~(quality.sigma_rad <= UNCERTAINTY_LIMIT_RAD)]
    if len(unsure) == 0:
        return outer
    sure = quality.angle_rad[seen & (quality.angle_rad < unsure[0])]
    return float(sure[-1]) if len(sure) else inner
