"""The equirectangular picture of a 360° camera: longitude across, latitude down.

Domain : the whole sphere. The centre pixel sees +z, columns to its right turn toward +x, rows below
it toward +y. In a picture of width W that shows the full turn, the columns from −½ to W − ½ span
2π: the seam runs along the picture's left and right edges, the poles along its top and bottom.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibration.models.radial import Focal, by_centre_and_focal, check_lens

_EDGE_RAD = 1e-9
"""What rounding may add to the angle of a pixel on the seam or a pole."""


@dataclass(frozen=True)
class Equirectangular:
    """x − cx = fx λ and y − cy = fy δ, with longitude λ = atan2(x, z) and δ the angle below level.

    Attributes
    ----------
    centre_px : (float, float)
        Pixel that sees +z.
    focal_px : float or (float, float)
        Pixels per radian; W / 2π and H / π for a picture of the full sphere.
    """

    name: ClassVar[str] = "equirectangular"
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
        directions = np.asarray(directions, np.float64)
        x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
        valid = np.isfinite(directions).all(axis=-1) & directions.any(axis=-1)
        angles = np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=-1)
        pixels = np.asarray(self.centre_px) + np.asarray(self.focal_px) * angles
        return np.where(valid[..., None], pixels, np.nan), np.asarray(valid)

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return unit directions (..., 3), camera frame, and validity (...) of pixels (..., 2)."""
        angles = (np.asarray(pixels, np.float64) - np.asarray(self.centre_px)) / self.focal_px
        longitude, latitude = angles[..., 0], angles[..., 1]
        valid = (np.abs(longitude) <= np.pi + _EDGE_RAD) & (
            np.abs(latitude) <= np.pi / 2 + _EDGE_RAD
        )
        longitude = np.where(valid, longitude, np.nan)
        latitude = np.where(valid, latitude, np.nan)
        level = np.cos(latitude)
        directions = np.stack(
            [level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude)], axis=-1
        )
        return directions, np.asarray(valid)

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P), NaN at poles."""
        directions = np.asarray(directions, np.float64)
        x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
        pixels, _ = self.project(directions)
        level = np.hypot(x, z)
        valid = np.isfinite(pixels).all(axis=-1) & (level > 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            longitude = np.stack([z, np.zeros_like(z), -x], axis=-1) / (level**2)[..., None]
            latitude = np.stack([-y * x / level, level, -y * z / level], axis=-1)
            latitude /= (level**2 + y**2)[..., None]
        focal = np.broadcast_to(np.asarray(self.focal_px), 2)
        by_direction = focal[:, None] * np.stack([longitude, latitude], axis=-2)
        angles = (pixels - np.asarray(self.centre_px)) / focal
        by_parameters = by_centre_and_focal(angles, self.focal_px)
        by_direction[~valid] = np.nan
        by_parameters[~valid] = np.nan
        return by_direction, by_parameters


def full_sphere(image_size_px: tuple[int, int]) -> Equirectangular:
    """Return the model of a picture (width, height) that shows the full sphere."""
    width, height = image_size_px
    return Equirectangular(
        centre_px=((width - 1) / 2, (height - 1) / 2),
        focal_px=(width / (2 * np.pi), height / np.pi),
    )
