"""Scaramuzza's omnidirectional model: a polynomial from radius to ray, and a sheared sensor.

Domain : up to where the angle stops growing with the radius, past 90° too.
Source : D. Scaramuzza, A. Martinelli, R. Siegwart, "A Flexible Technique for Accurate
Omnidirectional Camera Calibration and Structure from Motion", ICVS, 2006; the OCamCalib toolbox.
The polynomial is inverted to full precision, where the toolbox fits a second, approximate one.
Fails  : beyond the radii that were calibrated: a polynomial extrapolates to anything.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from calibration.models.radial import (
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


@dataclass(frozen=True)
class OCam:
    """The ray (ρ cos φ, ρ sin φ, z) with z = 1 + a2 ρ² + a3 ρ³ + …, ρ the radius in focal lengths.

    It lands at the pixel c + f · (u + e v, d u + c v) with (u, v) = ρ (cos φ, sin φ).

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian on the axis. With two, c adds nothing.
    coefficients : tuple of float
        a2, a3, …, of any count.
    c, d, e : float
        Stretch and shear of the sensor, named as in the toolbox; c − d e is positive.
    """

    name: ClassVar[str] = "ocam"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: Focal
    coefficients: tuple[float, ...]
    c: float = 1.0
    d: float = 0.0
    e: float = 0.0

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        if not np.all(np.isfinite(self.coefficients)):
            raise InputError(f"coefficients must be finite, got {self.coefficients}")
        if not 0 < self.c - self.d * self.e < np.inf:
            raise InputError(
                f"c - d e must be positive, or the picture is mirrored: got c {self.c}, "
                f"d {self.d}, e {self.e}"
            )

    @cached_property
    def limit_angle_rad(self) -> float:
        """Angle of the first radius at which it stops growing."""
        return float(self._angle(np.array(self._limit_radius)))

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3), camera frame."""
        ideal, valid = project_radial(
            directions, (0.0, 0.0), 1.0, self._radius, self.limit_angle_rad
        )
        focal, centre = np.asarray(self.focal_px), np.asarray(self.centre_px)
        return centre + focal * (ideal @ self._stretch.T), valid

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        offset = (np.asarray(pixels, np.float64) - np.asarray(self.centre_px)) / self.focal_px
        ideal = offset @ np.linalg.inv(self._stretch).T
        return unproject_radial(ideal, (0.0, 0.0), 1.0, self._angle, self._limit_radius)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        ideal_by_direction, ideal_by_parameters = radial_jacobian(
            directions, 1.0, self._derivatives, self.limit_angle_rad
        )
        ideal, by_coefficients = ideal_by_parameters[..., 2], ideal_by_parameters[..., 3:]
        focal = np.broadcast_to(np.asarray(self.focal_px), 2)[:, None]
        u, v, none = ideal[..., 0], ideal[..., 1], np.zeros(ideal.shape[:-1])
        by_stretch = np.stack([none, none, v, v, u, none], axis=-1).reshape(*none.shape, 2, 3)
        by_parameters = np.concatenate(
            [
                by_centre_and_focal(ideal @ self._stretch.T, self.focal_px),
                focal * self._stretch @ by_coefficients,
                focal * by_stretch,
            ],
            axis=-1,
        )
        by_parameters[np.isnan(u)] = np.nan
        return focal * self._stretch @ ideal_by_direction, by_parameters

    @property
    def _stretch(self) -> NDArray[np.float64]:
        return np.array([[1.0, self.e], [self.d, self.c]])

    @cached_property
    def _forward(self) -> Polynomial:
        """z(ρ), the ray's component along the axis in focal lengths."""
        return Polynomial([1.0, 0.0, *self.coefficients])

    @cached_property
    def _limit_radius(self) -> float:
        """First radius at which z − ρ dz/dρ, the sign of dθ/dρ, is 0."""
        terms = np.array([1.0, 0.0, *self.coefficients])
        return first_positive_root(terms * (1.0 - np.arange(len(terms))))

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.arctan2(radius, self._forward(radius)))

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return invert_rising(angle, self._angle_and_slope, angle, self._limit_radius)

    def _angle_and_slope(
        self, radius: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        forward = self._forward(radius)
        rest = forward - radius * self._forward.deriv()(radius)
        return np.arctan2(radius, forward), rest / (radius**2 + forward**2)

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        radius = self._radius(angle)
        forward = self._forward(radius)
        rest = forward - radius * self._forward.deriv()(radius)
        by_coefficients = [
            radius ** (order + 1) / rest for order in range(2, 2 + len(self.coefficients))
        ]
        return radius, (radius**2 + forward**2) / rest, by_coefficients


def from_ocamcalib(
    polynomial: tuple[float, ...],
    centre_row_column: tuple[float, float],
    c: float = 1.0,
    d: float = 0.0,
    e: float = 0.0,
) -> OCam:
    """Return the model that a calib_results.txt of the OCamCalib toolbox describes.

    Parameters
    ----------
    polynomial : tuple of float
        The direct mapping: pixels to pixels, the constant first and negative, the linear term 0.
    centre_row_column : (float, float)
        Row first, counted from 0 at the centre of a pixel, as the file has it.
    c, d, e : float
        The affine parameters, as the file has them.

    Raises
    ------
    InputError
        If the polynomial is not one of the toolbox's.
    """
    if len(polynomial) < 2 or not polynomial[0] < 0 or polynomial[1] != 0:
        raise InputError(
            "the polynomial of OCamCalib must begin with a negative constant and no linear term, "
            f"got {polynomial}"
        )
    # The toolbox's frame is (row, column, backward): its z and so every term has the other sign.
    focal_px = -polynomial[0]
    try:
        terms = [-a * focal_px ** (order - 1) for order, a in enumerate(polynomial)]
    except OverflowError:
        raise InputError(f"the polynomial of OCamCalib is too large, got {polynomial}") from None
    row, column = centre_row_column
    return OCam((column, row), focal_px, tuple(terms[2:]), c, d, e)
