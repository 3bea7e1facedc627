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
from numba import njit
from numpy.typing import NDArray

from calibration.models.radial import (
    Derivatives,
    Focal,
    check_lens,
    first_positive_root,
    project_radial,
    radial_jacobian,
    unproject_radial,
)
from capture.errors import InputError

_DERIVATIVE = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
"""Factors of dθ_d/dθ over those of θ_d / θ, both polynomials in θ²."""

_STARTS = 1024


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
        return float(min(np.sqrt(first_positive_root(self._coefficients * _DERIVATIVE)), np.pi))

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
        return unproject_radial(
            pixels, self.centre_px, self.focal_px, self._angle, self._limit_radius
        )

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        return radial_jacobian(directions, self.focal_px, self._derivatives, self.limit_angle_rad)

    @cached_property
    def _limit_radius(self) -> float:
        return float(self._radius(np.array([self.limit_angle_rad]))[0])

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return np.array([1.0, self.k1, self.k2, self.k3, self.k4])

    @cached_property
    def _start_angles(self) -> NDArray[np.float64]:
        """Angles at equal steps of θ_d from 0 to the limit, to three or more digits."""
        angle = np.linspace(0.0, self.limit_angle_rad, 4 * _STARTS)
        distorted = self._radius(angle)
        return np.interp(np.linspace(0.0, distorted[-1], _STARTS), distorted, angle)

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return _distorted(angle, self._coefficients)

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return _undistorted(radius, self._coefficients, self._start_angles, self._limit_radius)

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        slope = np.polynomial.polynomial.polyval(angle**2, self._coefficients * _DERIVATIVE)
        powers = [angle ** (2 * order + 1) for order in range(1, 5)]
        return self._radius(angle), slope, powers


@njit(cache=True, nogil=True)
def _distorted(angle: NDArray[np.float64], k: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return θ_d (n,) of angles (n,), with k the coefficients of θ, θ³, … θ⁹."""
    distorted = np.empty_like(angle)
    for i in range(len(angle)):
        square = angle[i] * angle[i]
        series = k[0] + square * (k[1] + square * (k[2] + square * (k[3] + square * k[4])))
        distorted[i] = angle[i] * series
    return distorted


@njit(cache=True, nogil=True, fastmath={"contract"})
def _undistorted(
    distorted: NDArray[np.float64],
    k: NDArray[np.float64],
    starts: NDArray[np.float64],
    limit_radius: float,
) -> NDArray[np.float64]:
    """Return the angles (n,) at which θ_d takes its values (n,), from 0 to `limit_radius`.

    Newton's method from between the starts, kept inside a bracket that halves where it would leave.
    """
    _, k1, k2, k3, k4 = k
    steps = len(starts) - 1
    angles = np.empty_like(distorted)
    for i in range(len(distorted)):
        at = distorted[i] * (steps / limit_radius)
        step = min(int(at), steps - 1)
        angle = starts[step] + (at - step) * (starts[step + 1] - starts[step])
        low, high = 0.0, starts[-1]
        for _ in range(60):  # bisection alone would reach full precision in as many steps
            square = angle * angle
            series = 1 + square * (k1 + square * (k2 + square * (k3 + square * k4)))
            slope = 1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4)))
            error = angle * series - distorted[i]
            if error <= 0:
                low = angle
            if error >= 0:
                high = angle
            following = angle - error / slope if slope > 0 else np.inf
            newton = low <= following <= high
            if not newton:
                following = (low + high) / 2
            change = abs(following - angle)
            angle = following
            # A step of Newton's squares the error, so that the next would be below rounding.
            if change < (1e-9 if newton else 1e-15):
                break
        angles[i] = angle
    return angles
