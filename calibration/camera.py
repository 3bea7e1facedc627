"""What a camera model is, and the camera as a whole: lens, picture size, pose and limits.

Domain : pixels (x, y) with integers at pixel centres; directions are unit vectors away from the
camera. Camera frame: +x right, +y down, +z forward. World frame: +Y up.
"""

from dataclasses import Field, dataclass, field, replace
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.reflectance import check_reflectance, reflected_share
from calibration.resizing import same_shape, scaled
from capture.arrays import read_only
from capture.errors import InputError

LEVEL = np.diag([-1.0, -1.0, 1.0])
"""R_world_camera of a camera held level and looking along the world's +Z."""

UP = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""R_world_camera of a camera that looks at the zenith, the top of its picture toward −Z."""

_ROUNDING_RAD = 1e-12
"""What rounding may add to the angle of a pixel on the valid angle itself."""


def yaw_rotation(yaw_rad: float) -> NDArray[np.float64]:
    """Return the rotation (3, 3) about the world's +Y that takes +Z toward +X.

    Counter-clockwise as seen from above: it turns a camera to the left.
    """
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


class CameraModel(Protocol):
    """A lens: where a direction lands in the picture, and which direction a pixel sees.

    Implementations are frozen dataclasses in calibration/models/, whose fields are the keys of the
    calibration file. tests/calibration/test_camera_contract.py states what each keeps to.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def name(self) -> str:
        """The model's name in a calibration file."""
        ...

    @property
    def axis_z(self) -> float:
        """The axis is (0, 0, axis_z): the centre pixel sees it, angles are measured from it.

        +1 for a lens; −1 for a mirror ball, whose middle shows the direction back to the camera.
        """
        ...

    @property
    def limit_angle_rad(self) -> float:
        """Largest angle from the axis that the model can represent."""
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

    def project_jacobian(
        self, directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P).

        Of directions (..., 3) as `project` takes them, in pixels per unit of a component, and of
        the parameters as calibration/models/parameters.py lists them. NaN where a direction is not
        valid or the projection has no derivative: opposite the axis, at an equirectangular pole.
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


@dataclass(frozen=True, eq=False)
class Calibration:
    """All that is known about how a camera sees directions.

    Attributes
    ----------
    model : CameraModel
    image_size_px : (int, int)
        (width, height) of the pictures it holds for.
    valid_angle_rad : float
        Angle from the model's axis beyond which it is not to be trusted. The model's own limit
        holds too.
    R_world_camera : (3, 3) float64
        Rotation that takes camera directions to the world; level and looking along +Z by default.
    image_circle : ImageCircle or None
    vignetting : tuple of float
        v1, v2, … of the relative illumination V(θ) = 1 + v1 θ² + v2 θ⁴ + …, θ in rad from the
        model's axis, positive up to the valid angle; empty for none.
    uneven_vignetting : tuple of float
        What is added to V(θ) where the lens is not the same all around: the coefficients of
        θ cos φ, θ sin φ, θ² cos 2φ and θ² sin 2φ, φ from the camera's +x toward its +y. Empty, 2 or
        4 of them.
    reflectance : tuple of float
        Of a mirror ball: the shares of red, green and blue light that falls straight on it which it
        reflects. Empty for all of it, at every angle.
    inner_angle_rad : float
        Angle from the model's axis within which it is not to be trusted: the middle of a mirror
        optic that shows a ring.
    """

    model: CameraModel
    image_size_px: tuple[int, int]
    valid_angle_rad: float
    R_world_camera: NDArray[np.float64] = field(default_factory=lambda: LEVEL)
    image_circle: ImageCircle | None = None
    vignetting: tuple[float, ...] = ()
    uneven_vignetting: tuple[float, ...] = ()
    reflectance: tuple[float, ...] = ()
    inner_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        width, height = self.image_size_px
        if width < 1 or height < 1:
            raise InputError(f"image_size_px must be positive, got {self.image_size_px}")
        if not 0 < self.valid_angle_rad <= np.pi + 1e-9:
            raise InputError(
                f"valid_angle_rad must be in (0, π], 3.14159 at most, got {self.valid_angle_rad}"
            )
        if not 0 <= self.inner_angle_rad < self.valid_angle_rad:
            raise InputError(
                "inner_angle_rad must be from 0 to less than valid_angle_rad, "
                f"got {self.inner_angle_rad}"
            )
        rotation = read_only("R_world_camera", self.R_world_camera, np.float64, (3, 3))
        within_unit = np.abs(rotation).max() < 1.1  # else its product might overflow
        is_rotation = within_unit and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
        if not is_rotation or np.linalg.det(rotation) < 0:
            raise InputError(
                "R_world_camera must be a rotation (orthonormal, determinant +1), "
                f"got {rotation.tolist()}"
            )
        object.__setattr__(self, "R_world_camera", rotation)
        if len(self.uneven_vignetting) not in (0, 2, 4):
            raise InputError(
                f"uneven_vignetting must be 2 or 4 numbers, got {len(self.uneven_vignetting)}"
            )
        angles = np.linspace(0.0, min(self.valid_angle_rad, self.model.limit_angle_rad), 257)
        darkest = self.relative_illumination(angles)
        for order, pair in enumerate(zip(*[iter(self.uneven_vignetting)] * 2, strict=True), 1):
            darkest = darkest - np.hypot(*pair) * angles**order
        if not np.all(darkest > 0):
            raise InputError(
                "vignetting must leave some light up to the valid angle: V(θ) = 1 + v1 θ² + … is "
                f"not positive there with {[*self.vignetting, *self.uneven_vignetting]}"
            )
        if self.reflectance:
            check_reflectance(self.reflectance)
            if not hasattr(self.model, "incidence_rad"):
                raise InputError(f"reflectance is a mirror ball's; the model is {self.model.name}")

    def unproject(self, pixels: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return world directions (..., 3) and validity (...) of pixels (..., 2).

        A pixel is valid inside the picture's edge (half a pixel beyond the outer centres), the
        image circle and the valid angle. Where the model has no direction it is NaN.
        """
        at = np.asarray(pixels, np.float64)
        directions, valid = self.model.unproject(at)
        return directions @ self.R_world_camera.T, valid & self._sees(at, directions)

    def project(self, directions: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of world directions (..., 3)."""
        in_camera = np.asarray(directions, np.float64) @ self.R_world_camera
        pixels, valid = self.model.project(in_camera)
        return pixels, valid & self._sees(pixels, in_camera)

    def relative_illumination(self, angle_rad: ArrayLike) -> NDArray[np.float64]:
        """V(θ): the share of the light on the axis that the lens passes at θ, all around it."""
        coefficients = np.array([1.0, *self.vignetting])
        return np.polynomial.polynomial.polyval(
            np.asarray(angle_rad, np.float64) ** 2, coefficients
        )

    def illumination(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Return the share of the light on the axis (...) from world directions (..., 3)."""
        in_camera = np.asarray(directions, np.float64) @ self.R_world_camera
        angle_rad = self._axis_angle(in_camera)
        share = self.relative_illumination(angle_rad)
        if self.uneven_vignetting:
            azimuth_rad = np.arctan2(in_camera[..., 1], in_camera[..., 0])
            terms = uneven_terms(angle_rad, azimuth_rad, len(self.uneven_vignetting))
            share = share + terms @ np.array(self.uneven_vignetting)
        return share

    def reflected_share(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Return the share of each channel that the ball reflects from world directions, (..., 3).

        For calibrations with a reflectance.
        """
        return reflected_share(self.reflectance, self.incidence_rad(directions))

    def incidence_rad(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Return the angle (...) to its normal at which light from world directions hits the ball.

        For calibrations of mirror balls.
        """
        of_axis_angle = getattr(self.model, "incidence_rad")  # noqa: B009
        return np.asarray(of_axis_angle(self.axis_angle(directions)), np.float64)

    def axis_angle(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Angle in rad between world directions (..., 3) and the model's axis."""
        return self._axis_angle(np.asarray(directions, np.float64) @ self.R_world_camera)

    def check_size(self, size_px: tuple[int, int], what: str) -> None:
        """Raise InputError unless the picture `what` has the size that the calibration holds for.

        A picture that is known to be a resized one can be used with `scaled_to(size_px)`.
        """
        width, height = size_px
        own_width, own_height = self.image_size_px
        if (width, height) == (own_width, own_height):
            return
        message = (
            f"{what} is {width}×{height} px but the calibration holds for {own_width}×{own_height}"
        )
        if same_shape(size_px, self.image_size_px):
            scale = f"{width / own_width:.6g}"
            raise InputError(
                f"{message}: if the picture was resized, scale the calibration file (lengths in "
                f"pixels × {scale}, centres to (x + ½) × {scale} − ½) or the picture"
            )
        raise InputError(f"{message}: use the calibration of this camera and picture size")

    def scaled_to(self, size_px: tuple[int, int]) -> "Calibration":
        """Return the calibration for the same pictures resized to (width, height).

        Raises
        ------
        InputError
            If the shape differs by more than the rounding of a side to whole pixels.
        """
        if not same_shape(size_px, self.image_size_px):
            raise InputError(
                f"a calibration for {self.image_size_px[0]}×{self.image_size_px[1]} px cannot be "
                f"scaled to {size_px[0]}×{size_px[1]}: the shape differs"
            )
        scale = np.array(size_px) / np.array(self.image_size_px)
        circle = self.image_circle
        return replace(
            self,
            model=scaled(self.model, scale),
            image_size_px=size_px,
            image_circle=None if circle is None else scaled(circle, scale),
        )

    def _axis_angle(self, in_camera: NDArray[np.floating]) -> NDArray[np.float64]:
        x, y, z = in_camera[..., 0], in_camera[..., 1], in_camera[..., 2]
        return np.asarray(np.arctan2(np.hypot(x, y), z * self.model.axis_z))

    def _sees(
        self, pixels: NDArray[np.floating], in_camera: NDArray[np.floating]
    ) -> NDArray[np.bool_]:
        x, y = pixels[..., 0], pixels[..., 1]
        width, height = self.image_size_px
        with np.errstate(invalid="ignore"):
            seen = (x >= -0.5) & (x <= width - 0.5) & (y >= -0.5) & (y <= height - 0.5)
            angle_rad = self._axis_angle(in_camera)
            seen &= angle_rad <= self.valid_angle_rad + _ROUNDING_RAD
            seen &= angle_rad >= self.inner_angle_rad - _ROUNDING_RAD
            if self.image_circle is not None:
                centre_x, centre_y = self.image_circle.centre_px
                seen &= np.hypot(x - centre_x, y - centre_y) <= self.image_circle.radius_px
        return np.asarray(seen)


def uneven_terms(angle_rad: ArrayLike, azimuth_rad: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return the first `count` of θ cos φ, θ sin φ, θ² cos 2φ, θ² sin 2φ: (..., count)."""
    angle, azimuth = np.asarray(angle_rad, np.float64), np.asarray(azimuth_rad, np.float64)
    orders = np.arange(1, count // 2 + 1)
    turned = orders * azimuth[..., None]
    pairs = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    pairs *= (angle[..., None] ** orders)[..., None]
    return pairs.reshape(*angle.shape, count)
