"""The extended unified model: projection through an ellipsoid, two shape parameters, no iteration.

Domain : up to where the radius stops growing, past 90° too: acos((α − 1)/α) where α > ½ and β = 1.
Source : B. Khomutenko, G. Garcia, P. Martinet, "An Enhanced Unified Camera Model", IEEE RA-L 1(1),
2016: the model and its inverse. With β = 1 it is the unified model without distortion.
Fails  : for lenses that its two numbers cannot follow, and it has no others.
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
class ExtendedUnified:
    """r = f sin θ / (α d + (1 − α) cos θ) with d = √(β sin² θ + cos² θ).

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian on the axis.
    alpha : float
        Not negative: 0 is a pinhole; with β = 1, ½ is stereographic and 1 orthographic.
    beta : float
        Positive: the ellipsoid's shape, 1 for a sphere.
    """

    name: ClassVar[str] = "extended_unified"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: Focal
    alpha: float
    beta: float

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        check_alpha(self.alpha)
        if not 0 < self.beta < np.inf:
            raise InputError(f"beta must be positive, got {self.beta}")

    @cached_property
    def limit_angle_rad(self) -> float:
        """Angle at which the radius stops growing."""
        return sphere_limit(self.alpha, self.beta)

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
        return sphere_radius(angle, self.alpha, self.beta)

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return sphere_angle(radius, self.alpha, self.beta)

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        return sphere_derivatives(angle, self.alpha, self.beta)
