"""The double sphere model: two spheres in a row, two shape parameters, no iteration.

Domain : up to where the radius stops growing (α > ½) or has no bound (α ≤ ½), past 90° too.
Source : V. Usenko, N. Demmel, D. Cremers, "The Double Sphere Camera Model", 3DV, 2018. Here the
first sphere takes the angle θ to ψ, and the second is a unified model of ψ, which the limit is of.
Fails  : for lenses that its two numbers cannot follow; |ξ| ≥ 1 is not taken.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibration.models.radial import (
    Derivatives,
    Focal,
    check_lens,
    project_radial,
    radial_jacobian,
    unproject_radial,
)
from calibration.models.sphere import (
    check_alpha,
    sphere_angle,
    sphere_derivatives,
    sphere_limit,
    sphere_radius,
)
from capture.errors import InputError


@dataclass(frozen=True)
class DoubleSphere:
    """r = f sin ψ / (α + (1 − α) cos ψ), with ψ the angle of the point on the sphere seen from −ξ.

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels: 1 + ξ times the pixels per radian on the axis.
    xi : float
        Distance between the spheres' centres, in (−1, 1).
    alpha : float
        Not negative: the second sphere, as in the extended unified model.
    """

    name: ClassVar[str] = "double_sphere"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: Focal
    xi: float
    alpha: float

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        check_alpha(self.alpha)
        if not -1 < self.xi < 1:
            raise InputError(f"xi of a double sphere must be between -1 and 1, got {self.xi}")

    @cached_property
    def limit_angle_rad(self) -> float:
        """Angle at which the radius stops growing."""
        return float(self._angle_from_second(np.array(sphere_limit(self.alpha, 1.0))))

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3), camera frame."""
        return project_radial(
            directions, self.centre_px, self.focal_px, self._radius, self.limit_angle_rad
        )

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        limit_radius = float(self._radius(np.array(self.limit_angle_rad)))
        return unproject_radial(pixels, self.centre_px, self.focal_px, self._angle, limit_radius)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        return radial_jacobian(directions, self.focal_px, self._derivatives, self.limit_angle_rad)

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return sphere_radius(self._angle_to_second(angle), self.alpha, 1.0)

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._angle_from_second(sphere_angle(radius, self.alpha, 1.0))

    def _angle_to_second(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.arctan2(np.sin(angle), np.cos(angle) + self.xi))

    def _angle_from_second(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        # The law of sines in the triangle of both centres and the point on the first sphere.
        return np.asarray(angle + np.arcsin(self.xi * np.sin(angle)))

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        second = self._angle_to_second(angle)
        radius, slope, (by_alpha, _) = sphere_derivatives(second, self.alpha, 1.0)
        squared = 1.0 + 2.0 * self.xi * np.cos(angle) + self.xi**2
        by_xi = -slope * np.sin(angle) / squared
        return radius, slope * (1.0 + self.xi * np.cos(angle)) / squared, (by_xi, by_alpha)
