"""A lens with an axis of symmetry whose radius is a spline: for lenses that no polynomial fits.

Domain : up to its last angle or to where the radius stops growing, past 90° too.
Source : the idea of D. Kogan's mrcal, whose splined models correct a stereographic lens by a
surface; here the profile alone is a spline, the axis's symmetry is kept, and the base is
equidistant.
Fails  : a value that no measurement reaches means nothing; for lenses without an axis of symmetry.
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
    first_positive_root,
    invert_rising,
    project_radial,
    radial_jacobian,
    unproject_radial,
)
from capture.errors import InputError

_BASIS = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0
"""The four cubic B-splines over one step: powers 0 to 3 of the place in the step, one a row."""

_BASIS_SLOPE = _BASIS[:, 1:] * [1.0, 2.0, 3.0]


@dataclass(frozen=True)
class SplinedRadial:
    """r = f (θ + s(θ)), with s a cubic B-spline, odd about the axis and without slope there.

    The n deviations cut the angles from 0 to the end into n equal steps h. They are the control
    values of s at 2h, 3h, … (n + 1) h; those at −h, 0 and h are 0, so that f is the focal length.

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian on the axis.
    end_angle_rad : float
        Angle from the axis at which the spline ends, at most π.
    deviations : tuple of float
        Control values, in focal lengths; all 0 is the equidistant lens.
    """

    name: ClassVar[str] = "splined_radial"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: Focal
    end_angle_rad: float
    deviations: tuple[float, ...]

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)
        if not 0 < self.end_angle_rad <= np.pi:
            raise InputError(f"end_angle_rad must be in (0, π], got {self.end_angle_rad}")
        if not self.deviations or not np.all(np.isfinite(self.deviations)):
            raise InputError(f"deviations must be finite, at least one; got {self.deviations}")

    @cached_property
    def limit_angle_rad(self) -> float:
        """First angle at which the radius stops growing, at most the spline's end."""
        step = self.end_angle_rad / len(self.deviations)
        for start, values in enumerate(self._control_values):
            slope = values @ _BASIS_SLOPE + [step, 0.0, 0.0]
            turn = first_positive_root(slope) if slope[0] > 1e-12 * step else 0.0
            if turn <= 1:
                return (start + turn) * step
        return self.end_angle_rad

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
        limit_radius = float(self._radius(np.array([self.limit_angle_rad]))[0])
        return unproject_radial(pixels, self.centre_px, self.focal_px, self._angle, limit_radius)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        return radial_jacobian(directions, self.focal_px, self._derivatives, self.limit_angle_rad)

    @cached_property
    def _control_values(self) -> NDArray[np.float64]:
        """The four control values (n, 4) of each step."""
        values = np.array([0.0, 0.0, 0.0, *self.deviations])
        return np.lib.stride_tricks.sliding_window_view(values, 4)

    def _place(self, angle: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return the step (n,) an angle lies in, and powers 0 to 3 (n, 4) of its place there."""
        count = len(self.deviations)
        along = angle * (count / self.end_angle_rad)
        step = np.clip(along.astype(np.intp), 0, count - 1)
        return step, np.power.outer(along - step, np.arange(4))

    def _radius(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._radius_and_slope(angle)[0]

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return invert_rising(radius, self._radius_and_slope, radius, self.limit_angle_rad)

    def _radius_and_slope(
        self, angle: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        step, powers = self._place(angle)
        values = self._control_values[step]
        deviation = np.sum(values * (powers @ _BASIS.T), axis=-1)
        deviation_slope = np.sum(values * (powers[:, :3] @ _BASIS_SLOPE.T), axis=-1)
        steps_per_rad = len(self.deviations) / self.end_angle_rad
        return angle + deviation, 1.0 + steps_per_rad * deviation_slope

    def _derivatives(self, angle: NDArray[np.float64]) -> Derivatives:
        radius, slope = self._radius_and_slope(angle)
        by_end = (1.0 - slope) * angle / self.end_angle_rad
        step, powers = self._place(angle)
        count = len(self.deviations)
        by_value = np.zeros((len(angle), count + 3))
        np.put_along_axis(by_value, step[:, None] + np.arange(4), powers @ _BASIS.T, axis=1)
        return radius, slope, (by_end, *by_value[:, 3:].T)
