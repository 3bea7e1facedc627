"""A mirror ball anywhere in the picture of a pinhole camera: exact where its outline is an ellipse.

Domain : everything but the blind cone behind the ball, of half-angle asin(1 / distance_ratio).
The frame looks along +z at the ball's centre, the camera's own turned by the shortest way; so the
pixel of the ball's centre shows the direction −z, back to the camera.
Fails  : as mirror_ball.py does, near things and near the outline; for lenses that distort, whose
pictures have to be made straight first.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibration.models.mirror_ball import MirrorBall
from calibration.models.radial import Focal, check_lens
from capture.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MirrorBallOffAxis:
    """Reflection in a sphere that a pinhole sees at an angle to its axis.

    Attributes
    ----------
    centre_px : (float, float)
        Where the ball's centre is seen; not the middle of the outline.
    principal_px : (float, float)
        Where the camera's axis meets the picture, or would if it was not cropped.
    focal_px : float or (float, float)
        The camera's focal length.
    distance_ratio : float
        Distance from the camera to the ball's centre over the ball's radius, above 1.
    """

    name: ClassVar[str] = "mirror_ball_off_axis"
    axis_z: ClassVar[float] = -1.0

    centre_px: tuple[float, float]
    principal_px: tuple[float, float]
    focal_px: Focal
    distance_ratio: float

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        if not np.all(np.isfinite(self.principal_px)):
            raise InputError(f"principal_px must be finite, got {self.principal_px}")
        self._ball()

    @property
    def limit_angle_rad(self) -> float:
        """Largest angle from −z that the ball shows: its outline."""
        return self._ball().limit_angle_rad

    @property
    def R_camera_ball(self) -> Array:  # noqa: N802
        """Rotation (3, 3) from the frame of the directions to the camera's own."""
        x, y, z = self._axis()
        s = 1.0 + z
        return np.array(
            [[1 - x * x / s, -x * y / s, x], [-x * y / s, 1 - y * y / s, y], [-x, -y, z]]
        )

    def project(self, directions: NDArray[np.floating]) -> tuple[Array, NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3)."""
        seen, valid = self._ball().project(directions)
        rays = self._camera_rays(seen)
        valid = valid & (rays[..., 2] > 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            pixels = self.principal_px + np.multiply(self.focal_px, rays[..., :2] / rays[..., 2:])
        return np.where(valid[..., None], pixels, np.nan), valid

    def unproject(self, pixels: NDArray[np.floating]) -> tuple[Array, NDArray[np.bool_]]:
        """Return unit directions (..., 3) and validity (...) of pixels (..., 2)."""
        at = (np.asarray(pixels, np.float64) - self.principal_px) / self.focal_px
        rays = np.concatenate([at, np.ones_like(at[..., :1])], axis=-1) @ self.R_camera_ball
        forward = rays[..., 2:] > 0
        with np.errstate(invalid="ignore", divide="ignore"):
            seen = np.where(forward, rays[..., :2] / rays[..., 2:], np.nan)
        return self._ball().unproject(seen)

    def project_jacobian(self, directions: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        ball, rotation = self._ball(), self.R_camera_ball
        focal = np.broadcast_to(np.asarray(self.focal_px, np.float64), 2)
        seen, _ = ball.project(directions)
        rays = self._camera_rays(seen)
        depth = rays[..., 2, None, None]
        image = rays[..., :2, None] / depth

        def to_pixels(by: NDArray[np.float64]) -> Array:
            """∂pixel of ∂ray (..., 3, k)."""
            return focal[:, None] * (by[..., :2, :] - image * by[..., 2:, :]) / depth

        by_seen = to_pixels(np.broadcast_to(rotation[:, :2], (*seen.shape[:-1], 3, 2)))
        ball_by_direction, ball_by_parameters = ball.project_jacobian(directions)
        by_radius, by_ratio = ball_by_parameters[..., 2], ball_by_parameters[..., 3]
        growth = -self.distance_ratio * (self.distance_ratio**2 - 1) ** -1.5
        by_distance = by_seen @ (by_ratio + growth * by_radius)[..., None]

        # The axis of the ball moves with a = (centre − principal) / focal.
        by_a = to_pixels(self._rays_by_axis(seen) @ self._axis_by_offset())
        by_centre = by_a / focal
        offset = np.subtract(self.centre_px, self.principal_px) / focal
        by_focal = image * np.eye(2) - by_centre * offset
        if np.ndim(self.focal_px) == 0:
            by_focal = by_focal.sum(axis=-1, keepdims=True)
        by_parameters = [by_centre, np.eye(2) - by_centre, by_focal, by_distance]
        return by_seen @ ball_by_direction, np.concatenate(by_parameters, axis=-1)

    def incidence_rad(self, angle_rad: Array) -> Array:
        """Return at which angle to the surface's normal the ball is hit, by the angle θ from −z."""
        return self._ball().incidence_rad(angle_rad)

    def _ball(self) -> MirrorBall:
        """Return the ball as a camera of focal length 1 sees it that points at its centre."""
        ratio = self.distance_ratio
        radius = (ratio**2 - 1) ** -0.5 if ratio > 1 else 1.0
        return MirrorBall((0.0, 0.0), radius, ratio)

    def _axis(self) -> Array:
        """Return the unit vector (3,) from the camera to the ball's centre, in its own frame."""
        offset = np.subtract(self.centre_px, self.principal_px) / self.focal_px
        axis = np.append(offset, 1.0)
        return axis / np.linalg.norm(axis)

    def _axis_by_offset(self) -> Array:
        """Return ∂axis/∂a (3, 2), of the axis (a, 1) / |(a, 1)|."""
        axis = self._axis()
        return axis[2] * (np.eye(3) - np.outer(axis, axis))[:, :2]

    def _camera_rays(self, seen: Array) -> Array:
        """Return rays (..., 3) in the camera's frame of image points (..., 2) about the ball."""
        rotation = self.R_camera_ball
        return seen @ rotation[:, :2].T + rotation[:, 2]

    def _rays_by_axis(self, seen: Array) -> Array:
        """Return ∂ray/∂axis (..., 3, 3): of R_camera_ball by x, y and z, times (seen, 1)."""
        x, y, z = self._axis()
        s = 1.0 + z
        by_x = [[-2 * x / s, -y / s, 1.0], [-y / s, 0.0, 0.0], [-1.0, 0.0, 0.0]]
        by_y = [[0.0, -x / s, 0.0], [-x / s, -2 * y / s, 1.0], [0.0, -1.0, 0.0]]
        by_z = [[x * x / s**2, x * y / s**2, 0.0], [x * y / s**2, y * y / s**2, 0.0], [0, 0, 1.0]]
        rays = np.concatenate([seen, np.ones_like(seen[..., :1])], axis=-1)
        return np.einsum("kij,...j->...ik", np.array([by_x, by_y, by_z]), rays)
