"""How far a calibrated lens is to be trusted: uncertainty by angle, and the valid angle.

Every lens that predicts new views as well as the best is possible. To the noise of the chosen
lens is added the mean square of its difference from them. Beyond the corners no view tells the
possible lenses apart, and the noise is the mean of theirs, so that a stiff lens is not taken for a
sure one there.
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
    sigma_by_angle,
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
        Standard deviation of a direction along its worse tangent, rms over the azimuths: the
        corners' noise carried through the fit, and what the choice of the model leaves open.
        Infinite where there is no direction.
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
    apart = np.stack([_square_difference(trial, model, at) for trial in plausible])
    noise = np.stack([_noise(trial, at) for trial in plausible])
    inside = at.angle_rad <= seen_rad[1]
    own = noise[plausible.index(best)]
    of_noise = np.where(inside[:, None, None, None], own, _mean_known(noise))
    covariance = of_noise + _mean_known(apart)
    odd, even = (
        _refitted(corners, best, np.arange(first, corners.view_count, 2)) for first in (0, 1)
    )
    split = direction_difference(odd, even, at)
    return Quality(
        at.angle_rad,
        sigma_by_angle(covariance),
        np.sqrt(np.sum(split**2, axis=-1).mean(axis=-1)),
        seen_rad,
    )


def _noise(trial: Trial, at: Fan) -> Array:
    """Return the covariance (A, 16, 2, 2) of a trial's directions, NaN where it has none."""
    free, count = trial.candidate.free, trial.free.lens_count
    return direction_covariance(
        trial.fit.solution.model, free, trial.fit.covariance[:count, :count], at
    )


def _square_difference(trial: Trial, model: CameraModel, at: Fan) -> Array:
    """Return the square (A, 16, 2, 2) of the model's error if the trial were the truth."""
    apart = direction_difference(trial.fit.solution.model, model, at)
    return np.asarray(apart[..., :, None] * apart[..., None, :])


def _mean_known(values: Array) -> Array:
    """Return the mean over the first axis of what is known; NaN where nothing is."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.asarray(np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan))


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


def inner_angle(quality: Quality) -> float:
    """Return the angle within which no corner was seen and directions are not sure enough, or 0."""
    inner, _ = quality.seen_rad
    unsure = quality.angle_rad[~(quality.sigma_rad <= UNCERTAINTY_LIMIT_RAD)]
    return inner if np.any(unsure < inner) else 0.0
