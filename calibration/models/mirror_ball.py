"""A mirror ball photographed from a finite distance: exact, the camera's perspective included.

Domain : everything but the blind cone behind the ball, of half-angle asin(1 / distance_ratio).
The camera frame is the camera's: it looks along +z at the ball's centre, so the middle of the ball
shows the direction −z, back to the camera, and angles from the axis are angles from −z.
Fails  : for things near the ball, which it sees from points on its surface instead of its centre;
for a ball far off the camera's optical axis, whose outline is an ellipse; near the outline, where a
pixel covers ever larger angles.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibration.models.radial import (
    Derivatives,
    check_lens,
    project_radial,
    radial_jacobian,
    unproject_radial,
)
from capture.errors import InputError

_FLIP_Z = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class MirrorBall:
    """Reflection in a sphere.

    A ray at the angle α from the line to the ball's centre meets the ball at the incidence angle
    i = asin(D sin α), with D the distance ratio, and leaves at θ = 2 i − α from −z.

    Attributes
    ----------
    centre_px : (float, float)
        Centre of the ball's outline in the picture.
    radius_px : float
        Radius of the ball's outline in the picture.
    distance_ratio : float
        Distance from the camera to the ball's centre over the ball's radius, above 1.
    """

    name: ClassVar[str] = "mirror_ball"
    axis_z: ClassVar[float] = -1.0

    centre_px: tuple[float, float]
    radius_px: float
    distance_ratio: float

    def __post_init__(self) -> None:
        check_lens(self.centre_px, 1.0)
        if not (np.isfinite(self.radius_px) and self.radius_px > 0):
            raise InputError(f"radius_px must be positive, got {self.radius_px}")
        if not (np.isfinite(self.distance_ratio) and self.distance_ratio > 1):
            raise InputError(
                "distance_ratio (camera to the ball's centre, over the ball's radius) must be "
                f"above 1, got {self.distance_ratio}"
            )

    @property
    def limit_angle_rad(self) -> float:
        """Largest angle from −z that the ball shows: its outline."""
        return float(np.pi - np.arcsin(1.0 / self.distance_ratio))

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3), camera frame."""
        backward = np.asarray(directions, np.float64) * _FLIP_Z
        return project_radial(
            backward, self.centre_px, self.radius_px, self._radius, self.limit_angle_rad
        )

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        backward, valid = unproject_radial(pixels, self.centre_px, self.radius_px, self._angle, 1.0)
        return backward * _FLIP_Z, valid

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        backward = np.asarray(directions, np.float64) * _FLIP_Z
        by_backward, by_parameters = radial_jacobian(
            backward, self.radius_px, self._derivatives, self.limit_angle_rad
        )
        return by_backward * _FLIP_Z, by_parameters

    def incidence_rad(self, angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return at which angle to the surface's normal the ball is hit, by the angle θ from −z.

        Newton's method for θ = 2 i − α(i): θ(i) rises with a slope between 1 and 2 and is convex,
        so that from the second step on the iterates fall toward the root.
        """
        ratio_squared = self.distance_ratio**2
        incidence = angle_rad / 2.0
        for _ in range(60):
            sine = np.sin(incidence)
            error = 2.0 * incidence - np.arcsin(sine / self.distance_ratio) - angle_rad
            slope = 2.0 - np.cos(incidence) / np.sqrt(ratio_squared - sine**2)
            following = np.clip(incidence - error / slope, 0.0, np.pi / 2)
            change = np.abs(following - incidence).max(initial=0.0)
            incidence = following
            if change < 1e-15:
                break
        return incidence

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radius over the outline's: r ∝ tan α in perspective, and sin α = sin i / D."""
        ratio_squared = self.distance_ratio**2
        sine = np.sin(self.incidence_rad(angle))
        return sine * np.sqrt((ratio_squared - 1.0) / (ratio_squared - sine**2))

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        ratio, ratio_squared = self.distance_ratio, self.distance_ratio**2
        incidence = self.incidence_rad(angle)
        sine, cosine = np.sin(incidence), np.cos(incidence)
        rest = ratio_squared - sine**2
        radius = sine * np.sqrt((ratio_squared - 1.0) / rest)
        by_incidence = np.sqrt(ratio_squared - 1.0) * cosine * ratio_squared / rest**1.5
        slope = by_incidence / (2.0 - cosine / np.sqrt(rest))
        # At one θ, more distance turns the normal: ∂i/∂D = −(∂θ/∂D) / (∂θ/∂i).
        by_ratio = radius * ratio * cosine**2 / ((ratio_squared - 1.0) * rest)
        by_ratio -= slope * sine / (ratio * np.sqrt(rest))
        return radius, slope, (by_ratio,)

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        ratio_squared = self.distance_ratio**2
        view = np.arctan(radius / np.sqrt(ratio_squared - 1.0))
        # asin(D sin α) as an arctangent, which keeps its precision near the outline.
        adjacent = np.sqrt((ratio_squared - 1.0) * (1.0 - radius) * (1.0 + radius))
        incidence = np.arctan2(self.distance_ratio * radius, adjacent)
        return 2.0 * incidence - view
