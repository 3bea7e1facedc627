"""The orthographic fisheye: the hemisphere seen from infinitely far."""

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
class Orthographic:
    """r = f sin θ, to 90° from the axis, where pixels cover ever larger angles.

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian on the axis.
    """

    name: ClassVar[str] = "orthographic"
    axis_z: ClassVar[float] = 1.0
    limit_angle_rad: ClassVar[float] = np.pi / 2

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
        return unproject_radial(pixels, self.centre_px, self.focal_px, _angle, 1.0)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        return radial_jacobian(directions, self.focal_px, _derivatives, self.limit_angle_rad)


def _radius(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sin(angle)


def _angle(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    # The arcsine as an arctangent keeps its precision near the rim.
    return np.arctan2(radius, np.sqrt((1.0 - radius) * (1.0 + radius)))


def _derivatives(angle: NDArray[np.float64]) -> Derivatives:
    return _radius(angle), np.cos(angle), ()
