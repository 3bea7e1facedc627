"""The unified model with radial and tangential distortion: what OpenCV's omnidir calibrates.

Domain : up to where the sphere's radius stops growing (ξ > 1) or has no bound (ξ ≤ 1), and within
the disc on which the distortion is one-to-one.
Source : C. Mei, P. Rives, "Single View Point Omnidirectional Camera Calibration from Planar Grids",
ICRA, 2007; without skew.
Fails  : tangential distortion folds the picture earlier on one side; what lies as far out on the
others is refused too.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibration.models.radial import (
    FARTHEST,
    Derivatives,
    Focal,
    by_centre_and_focal,
    check_lens,
    first_positive_root,
    invert_rising,
    project_radial,
    radial_jacobian,
    unproject_radial,
)
from capture.errors import InputError

_ROUNDING = 1e-15

_SETTLED = 1e-13
"""Residual, in focal lengths and relative, at which a distortion counts as inverted."""


@dataclass(frozen=True)
class Unified:
    """The point m = (x, y) / (z + ξ) of a unit direction, distorted and scaled by f.

    With r² = |m|² and p = (p2, p1), it is distorted to m (1 + k1 r² + k2 r⁴ + 2 p·m) + p r².

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels: 1 + ξ times the pixels per radian on the axis.
    xi : float
        Distance from the sphere's centre to the centre of projection, above −1.
    k1, k2, p1, p2 : float
        Radial and tangential coefficients, as in OpenCV.
    """

    name: ClassVar[str] = "unified"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: Focal
    xi: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        if not -1 < self.xi < np.inf:
            raise InputError(f"xi must be above -1, got {self.xi}")
        distortion = (self.k1, self.k2, self.p1, self.p2)
        if not np.all(np.isfinite(distortion)):
            raise InputError(f"k1, k2, p1, p2 must be finite, got {distortion}")

    @cached_property
    def limit_angle_rad(self) -> float:
        """Angle of the largest |m| that is taken."""
        return float(self._angle(np.array(self._limit_radius)))

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3), camera frame."""
        ideal, valid = project_radial(
            directions, (0.0, 0.0), 1.0, self._radius, self.limit_angle_rad
        )
        return np.asarray(self.centre_px) + self.focal_px * self._distorted(ideal), valid

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        distorted = (np.asarray(pixels, np.float64) - np.asarray(self.centre_px)) / self.focal_px
        ideal = self._undistorted(distorted.reshape(-1, 2)).reshape(distorted.shape)
        return unproject_radial(ideal, (0.0, 0.0), 1.0, self._angle, self._limit_radius)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        ideal_by_direction, ideal_by_parameters = radial_jacobian(
            directions, 1.0, self._derivatives, self.limit_angle_rad
        )
        ideal, by_xi = ideal_by_parameters[..., 2], ideal_by_parameters[..., 3:]
        focal = np.broadcast_to(np.asarray(self.focal_px), 2)[:, None]
        onto_sensor = focal * self._distortion_jacobian(ideal)
        squared = np.sum(ideal**2, axis=-1, keepdims=True)
        tangential = 2.0 * ideal[..., :, None] * ideal[..., None, :]
        tangential += squared[..., None] * np.eye(2)
        by_distortion = np.stack(
            [ideal * squared, ideal * squared**2, tangential[..., 1], tangential[..., 0]], axis=-1
        )
        by_parameters = np.concatenate(
            [
                by_centre_and_focal(self._distorted(ideal), self.focal_px),
                onto_sensor @ by_xi,
                focal * by_distortion,
            ],
            axis=-1,
        )
        by_parameters[np.isnan(squared[..., 0])] = np.nan
        return onto_sensor @ ideal_by_direction, by_parameters

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.sin(angle) / (np.cos(angle) + self.xi))

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        squared = radius**2
        root = np.sqrt(np.maximum(1.0 + (1.0 - self.xi**2) * squared, 0.0))
        length = (self.xi + root) / (1.0 + squared)
        return np.asarray(np.arctan2(length * radius, length - self.xi))

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        depth = np.cos(angle) + self.xi
        radius = np.sin(angle) / depth
        return radius, (1.0 + self.xi * np.cos(angle)) / depth**2, (-radius / depth,)

    @cached_property
    def _limit_radius(self) -> float:
        """Largest |m|: the rim of the sphere, or where the distortion may stop being one-to-one.

        The distortion is the gradient of a function, its Jacobian symmetric. Without p the
        eigenvalues are g = 1 + k1 r² + k2 r⁴ and d(r g)/dr, and p lowers them by up to 6 |p| r:
        where both are above that, the function is strictly convex and its gradient one-to-one.
        """
        lowering = -6.0 * np.hypot(self.p1, self.p2)
        radial = np.array([1.0, lowering, self.k1, 0.0, self.k2])
        slope = np.array([1.0, lowering, 3.0 * self.k1, 0.0, 5.0 * self.k2])
        rim = FARTHEST if self.xi <= 1 else float(1.0 / np.sqrt(self.xi**2 - 1.0))
        return min(rim, first_positive_root(radial), first_positive_root(slope))

    def _distorted(self, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
        tangential = np.array([self.p2, self.p1])
        squared = np.sum(ideal**2, axis=-1, keepdims=True)
        factor = (
            1.0 + squared * (self.k1 + squared * self.k2) + 2.0 * (ideal @ tangential)[..., None]
        )
        return np.asarray(ideal * factor + tangential * squared)

    def _distortion_jacobian(self, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
        tangential = np.array([self.p2, self.p1])
        squared = np.sum(ideal**2, axis=-1)[..., None, None]
        radial = 1.0 + squared * (self.k1 + squared * self.k2)
        radial_slope = 2.0 * self.k1 + 4.0 * self.k2 * squared
        mixed = 2.0 * ideal[..., :, None] * tangential
        along = 2.0 * (ideal @ tangential)[..., None, None]
        jacobian = (radial + along) * np.eye(2) + mixed + np.swapaxes(mixed, -1, -2)
        return np.asarray(jacobian + radial_slope * ideal[..., :, None] * ideal[..., None, :])

    def _undistorted(self, distorted: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points (n, 2) of the disc that are distorted to `distorted`, NaN if none is.

        Newton's method, kept in the disc, from the inverse of the radial part.
        """
        finite = np.asarray(np.isfinite(distorted).all(axis=-1))
        wanted = np.where(finite[:, None], distorted, 0.0)
        size = np.hypot(wanted[:, 0], wanted[:, 1])
        start = invert_rising(size, self._radial_and_slope, size, self._limit_radius)
        ideal = wanted * (start / np.where(size > 0, size, 1.0))[:, None]
        for _ in range(50):  # by halves, as at the rim where the Jacobian is singular
            error = self._distorted(ideal) - wanted
            off = np.abs(error).max(axis=-1, initial=0.0) > _ROUNDING * (1.0 + size)
            following = ideal - _solved(self._distortion_jacobian(ideal), error)
            radius = np.hypot(following[:, 0], following[:, 1])
            following *= np.minimum(1.0, self._limit_radius / np.maximum(radius, 1e-300))[:, None]
            moved = np.abs(following - ideal).max(axis=-1, initial=0.0) > _ROUNDING
            ideal = following
            if not np.any(off & moved):
                break
        residual = np.abs(self._distorted(ideal) - wanted).max(axis=-1, initial=0.0)
        ideal[~finite | (residual > _SETTLED * (1.0 + size))] = np.nan
        return ideal

    def _radial_and_slope(
        self, radius: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        squared = radius**2
        value = radius * (1.0 + squared * (self.k1 + squared * self.k2))
        return value, 1.0 + squared * (3.0 * self.k1 + squared * 5.0 * self.k2)


def _solved(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the solutions (n, 2) of symmetric systems (n, 2, 2); 0 where a matrix is singular."""
    a, b, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1]
    determinant = (a * d - b * b)[:, None]
    x, y = right[:, 0], right[:, 1]
    scaled = np.stack([d * x - b * y, a * y - b * x], axis=-1)
    return np.divide(scaled, determinant, out=np.zeros_like(scaled), where=determinant > 0)
