"""The equidistant fisheye: equal angles are equal distances."""

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
class Equidistant:
    """r = f θ, to 180° from the axis.

    Attributes
    ----------
    centre_px : (float, float)
        Pixel on the optical axis.
    focal_px : float or (float, float)
        Focal length in pixels, per radian.
    """

    name: ClassVar[str] = "equidistant"
    axis_z: ClassVar[float] = 1.0
    limit_angle_rad: ClassVar[float] = np.pi

    centre_px: tuple[float, float]
    focal_px: Focal

    def __post_init__(self) -> None:
        check_lens(self.centre_px, self.focal_px)

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3), camera frame."""
        return project_radial(
            directions, self.centre_px, self.focal_px, _identity, self.limit_angle_rad
        )

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        return unproject_radial(pixels, self.centre_px, self.focal_px, _identity, np.pi)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P)."""
        return radial_jacobian(directions, self.focal_px, _derivatives, self.limit_angle_rad)


def _identity(value: NDArray[np.float64]) -> NDArray[np.float64]:
    return value


def _derivatives(angle: NDArray[np.float64]) -> Derivatives:
    return angle, np.ones_like(angle), ()
