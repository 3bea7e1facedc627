"""What a camera model is, and the camera as a whole: lens, picture size, pose and limits.

Domain : pixels (x, y) with integers at pixel centres; directions are unit vectors away from the
camera. Camera frame: +x right, +y down, +z forward. World frame: +Y up.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.errors import InputError

LEVEL = np.diag([-1.0, -1.0, 1.0])
"""R_world_camera of a camera held level and looking along the world's +Z."""

UP = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""R_world_camera of a camera that looks at the zenith, the top of its picture toward −Z."""


class CameraModel(Protocol):
    """A lens: where a direction lands in the picture, and which direction a pixel sees.

    Implementations are frozen dataclasses in calibration/models/, whose fields are the keys of the
    calibration file. tests/calibration/test_camera_contract.py states what each keeps to.
    """

    @property
    def name(self) -> str:
        """The model's name in a calibration file."""
        ...

    @property
    def limit_angle_rad(self) -> float:
        """Largest angle from the optical axis that the model can represent."""
        ...

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3) in the camera frame.

        Directions need not have unit length. Where validity is False the pixel is NaN.
        """
        ...

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return camera-frame unit directions (..., 3) and validity (...) of pixels (..., 2).

        Where validity is False the direction is NaN.
        """
        ...


@dataclass(frozen=True)
class ImageCircle:
    """The disc of the picture that the lens lights; pixels outside it are unseen."""

    centre_px: tuple[float, float]
    radius_px: float

    def __post_init__(self) -> None:
        if not self.radius_px > 0:
            raise InputError(f"image_circle radius_px must be positive, got {self.radius_px}")


@dataclass(frozen=True)
class Calibration:
    """All that is known about how a camera sees directions.

    Attributes
    ----------
    model : CameraModel
    image_size_px : (int, int)
        (width, height) of the pictures it holds for.
    valid_angle_rad : float
        Angle from the optical axis beyond which the model is not to be trusted.
    R_world_camera : (3, 3) float64
        Rotation that takes camera directions to the world; level and looking along +Z by default.
    image_circle : ImageCircle or None
    vignetting : tuple of float
        v1, v2, … of the relative illumination V(θ) = 1 + v1 θ² + v2 θ⁴ + …, θ in rad from the
        optical axis; empty for none.
    """

    model: CameraModel
    image_size_px: tuple[int, int]
    valid_angle_rad: float
    R_world_camera: NDArray[np.float64] = field(default_factory=LEVEL.copy)
    image_circle: ImageCircle | None = None
    vignetting: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        width, height = self.image_size_px
        if width < 1 or height < 1:
            raise InputError(f"image_size_px must be positive, got {self.image_size_px}")
        if not 0 < self.valid_angle_rad <= np.pi + 1e-9:
            raise InputError(f"valid_angle_rad must be in (0, π], got {self.valid_angle_rad}")
        rotation = read_only("R_world_camera", self.R_world_camera, np.float64, (3, 3))
        is_rotation = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
        if not is_rotation or np.linalg.det(rotation) < 0:
            raise InputError(
                "R_world_camera must be a rotation (orthonormal, determinant +1), "
                f"got {rotation.tolist()}"
            )
        object.__setattr__(self, "R_world_camera", rotation)

    def unproject(
        self, pixels: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return world directions (..., 3) and validity (...) of pixels (..., 2).

        A pixel is valid inside the picture's edge (half a pixel beyond the outer centres), the
        image circle and the valid angle.
        """
        pixels = np.asarray(pixels, np.float64)
        directions, valid = self.model.unproject(pixels)
        valid = valid & self._sees(pixels, directions)
        return directions @ self.R_world_camera.T, valid

    def project(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of world directions (..., 3)."""
        directions = np.asarray(directions, np.float64)
        in_camera = directions @ self.R_world_camera
        pixels, valid = self.model.project(in_camera)
        length = np.linalg.norm(in_camera, axis=-1, keepdims=True)
        return pixels, valid & self._sees(pixels, in_camera / length)

    def relative_illumination(self, angle_rad: NDArray[np.floating]) -> NDArray[np.float64]:
        """V(θ): the share of the light on the axis that the lens passes at the angle θ."""
        coefficients = np.array([1.0, *self.vignetting])
        return np.polynomial.polynomial.polyval(
            np.asarray(angle_rad, np.float64) ** 2, coefficients
        )

    def axis_angle(self, directions: NDArray[np.floating]) -> NDArray[np.float64]:
        """Angle in rad between unit world directions (..., 3) and the optical axis."""
        in_camera = np.asarray(directions, np.float64) @ self.R_world_camera
        return np.arctan2(np.hypot(in_camera[..., 0], in_camera[..., 1]), in_camera[..., 2])

    def _sees(
        self, pixels: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        x, y = pixels[..., 0], pixels[..., 1]
        width, height = self.image_size_px
        with np.errstate(invalid="ignore"):
            seen = (x >= -0.5) & (x <= width - 0.5) & (y >= -0.5) & (y <= height - 0.5)
            angle = np.arctan2(np.hypot(directions[..., 0], directions[..., 1]), directions[..., 2])
            seen &= angle <= self.valid_angle_rad + 1e-12
            if self.image_circle is not None:
                centre_x, centre_y = self.image_circle.centre_px
                seen &= np.hypot(x - centre_x, y - centre_y) <= self.image_circle.radius_px
        return np.asarray(seen)
