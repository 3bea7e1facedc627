"""R_world_camera from where the sun was seen and where it stood.

Input  : sightings in the camera frame and positions in the world, unit vectors (N, 3) each.
Output : the rotation, its uncertainty, and what each sighting says of it.
Method : the rotation that most sightings agree with, then Wahba's problem [1]_ by singular values
[2]_, reweighted until wrong sightings count for nothing, then over the right ones alone.
Domain : half of the sightings or more are right.
Fails  : a wrong clock or place is no residual: seen from another meridian or an hour later the sun
draws the same arc about the pole, but for the 0.4° a day by which it changes its declination. All
that a clock does, a rotation about the pole undoes, and the pose is wrong by it. Only another
knowledge of the pose, such as which way is up, can tell: see `clock_error`.

.. [1] G. Wahba, "A Least Squares Estimate of Satellite Attitude", SIAM Review 7(3), 1965.
.. [2] F. L. Markley, "Attitude Determination Using Vector Observations and the Singular Value
       Decomposition", Journal of the Astronautical Sciences 36(3), 1988.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.pose.sun_position import SUN_RATE_RAD_PER_S, celestial_pole
from capture.errors import InputError

Array = NDArray[np.float64]

_PAIRS = 400
_AGREES_RAD = np.deg2rad(2.0)
_WRONG_SIGMAS = 6.0
_SOFT_SIGMAS = 2.4
"""Scale of Cauchy's loss: 95 % efficient on normal errors."""

_ROUNDS = 20
_LARGEST_SIGMA_RAD = np.deg2rad(1.0)
_LARGEST_RMS_RAD = np.deg2rad(1.0)
_RAYLEIGH_MEDIAN = 1.1774
"""Median length of a vector of two normal coordinates of deviation 1."""


@dataclass(frozen=True, eq=False)
class SunPose:
    """A camera's pose by the sun.

    Attributes
    ----------
    R_world_camera : (3, 3) float64
    covariance_rad2 : (3, 3) float64
        Of a small rotation about the world's axes. Neighbouring sightings that err alike, as
        through an error of the lens, count for fewer.
    residual_rad : (N,) float64
        Angle between the sun as seen and as computed.
    kept : (N,) bool
        False for sightings that do not lie on the sun's path and were left out.
    span_rad : float
        Greatest angle between two kept positions of the sun.
    """

    R_world_camera: Array
    covariance_rad2: Array
    residual_rad: Array
    kept: NDArray[np.bool_]
    span_rad: float

    @property
    def rms_rad(self) -> float:
        """Rms residual of the kept sightings."""
        return float(np.sqrt(np.mean(self.residual_rad[self.kept] ** 2)))

    @property
    def heading_sigma_rad(self) -> float:
        """Standard deviation of north: of the rotation about the vertical."""
        return float(np.sqrt(self.covariance_rad2[1, 1]))

    @property
    def up_sigma_rad(self) -> float:
        """Standard deviation of the zenith, in the worse direction."""
        level = self.covariance_rad2[np.ix_([0, 2], [0, 2])]
        return float(np.sqrt(np.linalg.eigvalsh(level)[-1]))


def pose_by_sun(sighted: Array, sun: Array, sighting_sigma_rad: float) -> SunPose:
    """Return the pose that takes camera directions `sighted` (N, 3) to `sun` (N, 3) in the world.

    `sighting_sigma_rad` is the least standard deviation of a coordinate of a sighting, for few that
    happen to agree.

    Raises
    ------
    InputError
        If fewer than three sightings or less than half of them lie on the sun's path, if they miss
        it by more than 1° rms, or if the path is too short to tell the pose to 1°.
    """
    if len(sun) < 3:
        raise InputError(
            f"the sun was found in {len(sun)} pictures; three at least are needed, better fifty, "
            "from morning to afternoon"
        )
    R = rough_pose(sighted, sun)
    for _ in range(_ROUNDS):
        angle = _angles(sighted @ R.T, sun)
        scale = _SOFT_SIGMAS * _scale(angle, sighting_sigma_rad)
        R = _wahba(sighted, sun, 1.0 / (1.0 + (angle / scale) ** 2))
    angle = _angles(sighted @ R.T, sun)
    kept = angle <= _WRONG_SIGMAS * _scale(angle, sighting_sigma_rad)
    if kept.sum() < 3 or 2 * kept.sum() < len(sun):
        raise InputError(
            f"only {kept.sum()} of {len(sun)} bright spots lie on one path of the sun: leave out "
            "pictures with clouds, and check the date and the lens"
        )
    R = _wahba(sighted[kept], sun[kept], np.ones(int(kept.sum())))
    angle = _angles(sighted @ R.T, sun)
    covariance = _covariance(sighted[kept] @ R.T - sun[kept], sun[kept], sighting_sigma_rad)
    span = float(np.arccos(np.clip(sun[kept] @ sun[kept].T, -1, 1)).max())
    pose = SunPose(R, covariance, angle, kept, span)
    if pose.rms_rad > _LARGEST_RMS_RAD:
        raise InputError(
            f"the spots miss the sun's path by {np.rad2deg(pose.rms_rad):.1f}° rms: the "
            "calibration is not this lens's, a picture is mirrored, or the date is wrong"
        )
    sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    if not sigma <= _LARGEST_SIGMA_RAD:
        raise InputError(
            f"{kept.sum()} sightings over {np.rad2deg(span):.1f}° of the sun's path leave the "
            f"camera free to turn about it by ±{np.rad2deg(sigma):.1f}°: record the sun for two "
            "hours or more, better from morning to afternoon"
        )
    return pose


def clock_error(
    R_world_camera: Array, zenith: Array, latitude_rad: float
) -> tuple[float, float, float]:
    """Compare a pose by the sun with what is known of up, and lay the difference to the clock.

    Parameters
    ----------
    R_world_camera : (3, 3) float64
        By the sun.
    zenith : (3,) float64
        In the camera frame, from another source.
    latitude_rad : float
        Of the place.

    Returns
    -------
    tilt_rad : float
        Angle between the two zeniths.
    fast_s : float
        By how much the clock would be fast, or the place too far east by 15° an hour, that brings
        them nearest.
    left_rad : float
        What is then left of the angle.
    """
    up, pole = np.array([0.0, 1.0, 0.0]), celestial_pole(latitude_rad)
    found = R_world_camera @ zenith
    turn = np.arctan2(np.cross(found, up) @ pole, found @ up - (found @ pole) * (up @ pole))
    distances = _angles(np.stack([found, up]), np.stack([pole, pole]))
    tilt = float(_angles(found, up))
    return tilt, float(turn / SUN_RATE_RAD_PER_S), float(abs(distances[0] - distances[1]))


def rough_pose(sighted: Array, sun: Array) -> Array:
    """Return the rotation, of those that pairs of sightings give, that most others agree with."""
    first, second = np.triu_indices(len(sun), 1)
    separation = _angles(sun[first], sun[second])
    alike = np.abs(separation - _angles(sighted[first], sighted[second])) < _AGREES_RAD
    far = alike & (separation >= 0.3 * separation[alike].max(initial=0.0)) & (separation > 1e-6)
    pairs = np.flatnonzero(far)
    if not len(pairs):
        raise InputError(
            "no two bright spots are as far apart as the sun moved between them: the calibration "
            "is not this lens's, or the spots are not the sun"
        )
    pairs = pairs[np.unique(np.linspace(0, len(pairs) - 1, _PAIRS).astype(int))]
    first, second = first[pairs], second[pairs]
    world, camera = _frames(sun[first], sun[second]), _frames(sighted[first], sighted[second])
    rotations = world @ np.swapaxes(camera, -1, -2)
    misses = _angles(np.einsum("kij,nj->kni", rotations, sighted), sun)
    # A count of those within the limit, and among equals the one that misses them by least.
    score = np.sum(np.maximum(1.0 - (misses / _AGREES_RAD) ** 2, 0.0), axis=-1)
    return np.asarray(rotations[np.argmax(score)])


def _frames(first: Array, second: Array) -> Array:
    """Return right-handed frames (K, 3, 3), axes in columns, of pairs of directions (K, 3)."""
    middle = first + second
    normal = np.cross(first, second)
    axes = [middle, normal, np.cross(middle, normal)]
    return np.stack([each / np.linalg.norm(each, axis=-1, keepdims=True) for each in axes], -1)


def _wahba(sighted: Array, sun: Array, weights: Array) -> Array:
    """Return the rotation R that minimises Σ w |R sighted − sun|²."""
    left, _, right = np.linalg.svd((sun * weights[:, None]).T @ sighted)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    return np.asarray(left @ np.diag([1.0, 1.0, sign]) @ right)


def _covariance(residual: Array, sun: Array, least_sigma_rad: float) -> Array:
    """Return the covariance (3, 3) of a rotation fitted to residual vectors (N, 3), in order."""
    spare = max(2 * len(sun) - 3, 1)
    variance = max(float(np.sum(residual**2)) / spare, least_sigma_rad**2)
    information = len(sun) * np.eye(3) - sun.T @ sun
    inflated = variance * persistence_factor(residual, 3)
    values, axes = np.linalg.eigh(information)
    return np.asarray((axes * (inflated / np.maximum(values, 1e-12))) @ axes.T)


def persistence_factor(residual: Array, fitted: int) -> float:
    """Return by how much errors that persist from one to the next raise the variance of a fit.

    As a first-order autoregression has them. The numbers `fitted` to the residuals (N, K) have
    taken a part of what persisted.
    """
    share = np.sum(residual[1:] * residual[:-1]) / max(np.sum(residual**2), 1e-300)
    persistence = float(np.clip(share + fitted / len(residual), 0.0, 0.99))
    return (1 + persistence) / (1 - persistence)


def _scale(angle: Array, least_sigma_rad: float) -> float:
    """Return the standard deviation of a coordinate that the median of angles (N,) tells."""
    return max(float(np.median(angle)) / _RAYLEIGH_MEDIAN, least_sigma_rad)


def _angles(first: Array, second: Array) -> Array:
    """Return the angles (...) between unit vectors (..., 3), exact for small ones too."""
    chord = np.linalg.norm(first - second, axis=-1)
    return np.asarray(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))
