"""The stereographic fisheye: shapes keep their angles."""

from dataclasses import dataclass
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


@dataclass(frozen=True)
class Stereographic:
    """r = 2 f tan(θ/2), up to but not at 180° from the axis, which lies at infinity.

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian on the axis.
    """

    name: ClassVar[str] = "stereographic"
    axis_z: ClassVar[float] = 1.0
    limit_angle_rad: ClassVar[float] = float(np.nextafter(np.pi, 0.0))

    centre_px: tuple[float, float]
    focal_px: Focal

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3), camera frame."""
        return project_radial(
            directions, self.centre_px, self.focal_px, _radius, self.limit_angle_rad
        )

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        return unproject_radial(
            pixels, self.centre_px, self.focal_px, _angle, np.finfo(np.float64).max
        )

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        return radial_jacobian(directions, self.focal_px, _derivatives, self.limit_angle_rad)


def _radius(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return 2.0 * np.tan(angle / 2.0)


def _angle(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    return 2.0 * np.arctan(radius / 2.0)


def _derivatives(angle: NDArray[np.float64]) -> Derivatives:
    return _radius(angle), 1.0 / np.cos(angle / 2.0) ** 2, ()
