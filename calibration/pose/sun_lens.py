"""A lens's focal length and centre from the path of the sun, together with the camera's pose.

Input  : pixels of the sun and its directions in the world; a lens of the right kind whose focal
length is right to a tenth, as a data sheet has it.
Domain : models with `centre_px` and `focal_px`; what else they have, their distortion, stays as it
is. The path tells one length and two coordinates and no more: of a profile it would see a part.
Fails  : where the kind of lens or its distortion is another: that shows in the residual where the
path is long, and bends the focal length where it is short. Beyond the angles that the sun passed
nothing was measured.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from calibration.camera import CameraModel
from calibration.lens.uncertainty import fan
from calibration.pose.sun_track import persistence_factor, rough_pose
from capture.errors import InputError

Array = NDArray[np.float64]

_LARGEST_SIGMA_RAD = np.deg2rad(1.0)
"""Of a direction in the world, anywhere as far from the axis as the sun was."""

_LEAST_SIGHTINGS = 12
"""Twice the unknowns, so that what persists in the residuals can be told."""

_WRONG_SIGMAS = 6.0
_SOFT_SIGMAS = 2.4
_RAYLEIGH_MEDIAN = 1.1774
"""Median length of a vector of two normal coordinates of deviation 1."""

_UNSEEN_PX = 1e3

_STEPS = np.array([1e-3, 1e-3, 1e-3, 0.1, 0.1, 1e-3])
"""Of the rotation in rad, of the centre in px, of the focal length's logarithm."""


@dataclass(frozen=True, eq=False)
class LensBySun:
    """A lens and a pose that fit the sun's path.

    Attributes
    ----------
    model : CameraModel
    R_world_camera : (3, 3) float64
    covariance : (6, 6) float64
        Of a small rotation about the world's axes in rad, of the centre in px, and of the focal
        length as a share of it.
    kept : (N,) bool
        False for sightings that do not lie on the path and were left out.
    rms_px : float
        Length of the kept residuals.
    seen_rad : (float, float)
        Between which angles from the axis the sun was.
    direction_sigma_rad : float
        Standard deviation of a direction in the world, the worst up to the larger angle. Less than
        its parts tell: a shift of the centre is nearly a turn of the camera.
    """

    model: CameraModel
    R_world_camera: Array
    covariance: Array
    kept: NDArray[np.bool_]
    rms_px: float
    seen_rad: tuple[float, float]
    direction_sigma_rad: float

    @property
    def focal_sigma(self) -> float:
        """Standard deviation of the focal length, as a share of it."""
        return float(np.sqrt(self.covariance[5, 5]))

    @property
    def centre_sigma_px(self) -> float:
        """Standard deviation of the centre, in the worse direction."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:5, 3:5])[-1]))


def lens_by_sun(model: CameraModel, pixels: Array, sun: Array, least_sigma_px: float) -> LensBySun:
    """Return the lens and pose that fit pixels (N, 2) of the sun at `sun` (N, 3) best.

    `least_sigma_px` is the least standard deviation of a coordinate, for few that happen to agree.

    Raises
    ------
    InputError
        If the model has no centre and focal length, fewer than twelve or half of the sightings
        agree on a lens of its kind, or the path leaves directions as far from the axis as the sun
        was uncertain by more than 1°.
    """
    if not (hasattr(model, "centre_px") and hasattr(model, "focal_px")):
        raise InputError(
            f"--refine-lens moves a lens's centre_px and focal_px, and {model.name} has none: "
            "leave it out"
        )
    sighted, seen = model.unproject(pixels)
    R = rough_pose(sighted[seen], sun[seen])

    def misses(unknowns: Array, rows: NDArray[np.bool_]) -> Array:
        found, _ = _moved(model, unknowns).project(sun[rows] @ _turned(R, unknowns))
        return np.asarray(np.nan_to_num(found - pixels[rows], nan=_UNSEEN_PX).ravel())

    kept = np.ones(len(sun), np.bool_)
    unknowns = np.zeros(6)
    for _ in range(2):
        scale = _SOFT_SIGMAS * _scale(misses(unknowns, kept), least_sigma_px)
        unknowns = least_squares(
            misses, unknowns, x_scale=_STEPS, loss="cauchy", f_scale=scale, args=(kept,)
        ).x
    off = misses(unknowns, kept)
    kept = np.hypot(*off.reshape(-1, 2).T) <= _WRONG_SIGMAS * _scale(off, least_sigma_px)
    if 2 * kept.sum() < len(sun) or kept.sum() < _LEAST_SIGHTINGS:
        raise InputError(
            f"only {kept.sum()} of {len(sun)} sightings of the sun agree on a lens, "
            f"{_LEAST_SIGHTINGS} and half of them are wanted: record it from morning to "
            "afternoon, or leave --refine-lens out"
        )
    fit = least_squares(misses, unknowns, x_scale=_STEPS, args=(kept,))
    variance = max(2 * fit.cost / (len(fit.fun) - 6), least_sigma_px**2)
    # In units in which a step of each is alike, or the inverse would be of rounding.
    normal = (fit.jac * _STEPS).T @ (fit.jac * _STEPS)
    covariance = np.linalg.pinv(normal, rcond=1e-12, hermitian=True) * _STEPS * _STEPS[:, None]
    covariance *= variance * persistence_factor(fit.fun.reshape(-1, 2), 6)
    rms_px = float(np.sqrt(2 * fit.cost / kept.sum()))
    lens, R = _moved(model, fit.x), _turned(R, fit.x)
    seen = np.arccos(np.clip((sun[kept] @ R)[:, 2] * lens.axis_z, -1.0, 1.0))
    inner, outer = float(seen.min()), float(seen.max())
    sigma = _direction_sigma(lens, R, covariance, outer)
    if not sigma <= _LARGEST_SIGMA_RAD:
        raise InputError(
            f"the sun's path from {np.rad2deg(inner):.0f}° to {np.rad2deg(outer):.0f}° off the "
            f"axis, missed by {rms_px:.1f} px, leaves directions uncertain by "
            f"{np.rad2deg(sigma):.1f}°: record it from morning to afternoon, check the kind of "
            "lens, or leave --refine-lens out"
        )
    return LensBySun(lens, R, covariance, kept, rms_px, (inner, outer), sigma)


def _direction_sigma(lens: CameraModel, R: Array, covariance: Array, outer_rad: float) -> float:
    """Return the largest standard deviation of a direction in the world at fixed pixels."""
    at = fan((0.0, outer_rad), outer_rad, count=8).directions * (1.0, 1.0, lens.axis_z)
    pixels, _ = lens.project(at)
    moved = []
    for step in np.diag(_STEPS):
        ahead, behind = (
            _moved(lens, way).unproject(pixels)[0] @ _turned(R, way).T for way in (step, -step)
        )
        moved.append((ahead - behind) / (2.0 * step.sum()))
    jacobian = np.stack(moved, axis=-1)
    spread = jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)
    return float(np.sqrt(np.nanmax(np.linalg.eigvalsh(np.nan_to_num(spread))[..., -1])))


def _moved(model: CameraModel, unknowns: Array) -> CameraModel:
    """Return the model with its centre moved and its focal length changed by its logarithm."""
    centre = np.asarray(getattr(model, "centre_px")) + unknowns[3:5]  # noqa: B009
    focal = np.asarray(getattr(model, "focal_px")) * np.exp(unknowns[5])  # noqa: B009
    focal_px = tuple(focal.tolist()) if focal.ndim else float(focal)
    changed: CameraModel = replace(model, centre_px=tuple(centre.tolist()), focal_px=focal_px)
    return changed


def _turned(R: Array, unknowns: Array) -> Array:
    return np.asarray(Rotation.from_rotvec(unknowns[:3]).as_matrix() @ R)


def _scale(misses: Array, least_sigma_px: float) -> float:
    """Return the standard deviation of a coordinate that the median miss tells."""
    return max(
        float(np.median(np.hypot(*misses.reshape(-1, 2).T))) / _RAYLEIGH_MEDIAN, least_sigma_px
    )
