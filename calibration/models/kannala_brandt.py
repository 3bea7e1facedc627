"""The Kannala-Brandt fisheye, four terms: what OpenCV's fisheye module and many tools calibrate.

Domain : up to where the radius stops growing with the angle, past 90° too. OpenCV's own projection
goes through z and is wrong from 90° on; this one is not.
Source : J. Kannala, S. Brandt, "A generic camera model and calibration method for conventional,
wide-angle, and fish-eye lenses", PAMI 28(8), 2006: the radially symmetric part.
Fails  : beyond the angles that were calibrated: a polynomial extrapolates to anything.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibration.models.radial import Focal, check_lens, project_radial, unproject_radial
from capture.errors import InputError

_DERIVATIVE = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
"""Factors of dθ_d/dθ over those of θ_d / θ, both polynomials in θ²."""


@dataclass(frozen=True)
class KannalaBrandt:
    """r = f θ_d with θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian on the axis.
    k1, k2, k3, k4 : float
        OpenCV's fisheye coefficients.
    """

    name: ClassVar[str] = "kannala_brandt"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: Focal
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        if not np.all(np.isfinite(self._coefficients)):
            raise InputError(f"k1 … k4 must be finite, got {self._coefficients[1:]}")

    @cached_property
    def limit_angle_rad(self) -> float:
        """First angle at which θ_d stops growing, at most π."""
        slope_in_square = np.trim_zeros(self._coefficients * _DERIVATIVE, "b")
        roots = np.polynomial.Polynomial(slope_in_square).roots()
        turns = roots.real[(abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(min(np.sqrt(turns.min(initial=np.inf)), np.pi))

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

    @property
    def _coefficients(self) -> NDArray[np.float64]:
        return np.array([1.0, self.k1, self.k2, self.k3, self.k4])

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return angle * _even_polynomial(angle, self._coefficients)

    def _slope(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return _even_polynomial(angle, self._coefficients * _DERIVATIVE)

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        """Invert θ_d by Newton's method, kept inside a bracket that halves where it would leave."""
        low = np.zeros_like(radius)
        high = np.full_like(radius, self.limit_angle_rad)
        angle = np.minimum(radius, high)
        for _ in range(60):  # bisection alone would reach full precision in as many steps
            error = self._radius(angle) - radius
            low = np.where(error <= 0, angle, low)
            high = np.where(error >= 0, angle, high)
            slope = self._slope(angle)
            step = np.divide(error, slope, out=np.full_like(error, np.inf), where=slope > 0)
            newton = angle - step
            inside = (newton >= low) & (newton <= high)
            following = np.where(inside, newton, (low + high) / 2)
            change = np.abs(following - angle).max(initial=0.0)
            angle = following
            if change < 1e-15:
                break
        return angle


def _even_polynomial(
    angle: NDArray[np.float64], coefficients: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(np.polynomial.polynomial.polyval(angle**2, coefficients), np.float64)
