"""What formats share: a camera without our own extras, and numbers taken from a parsed file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.camera import Calibration, CameraModel
from calibration.models.equidistant import Equidistant
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.parameters import LARGEST
from capture.errors import InputError


@dataclass(frozen=True)
class ForeignCamera:
    """A lens and the size (width, height) of its pictures: what every format tells."""

    model: CameraModel
    image_size_px: tuple[int, int]


class NoCounterpart(InputError):
    """A format has no model that projects as this one does."""

    def __init__(self, calibration: Calibration, known: str) -> None:
        super().__init__(
            f"no model of the format projects as {calibration.model.name} does, only {known}; "
            "with --approximate the nearest of them is fitted and its error printed"
        )


def as_calibration(camera: ForeignCamera, valid_angle_rad: float | None = None) -> Calibration:
    """Return the camera as a calibration of a camera held level.

    No format tells how far from the axis its lens was measured. Without `valid_angle_rad` all that
    the picture shows is taken for valid, or all that the model can represent if that is less.
    """
    if valid_angle_rad is None:
        valid_angle_rad = _farthest_angle(camera)
    return Calibration(camera.model, camera.image_size_px, valid_angle_rad)


def _farthest_angle(camera: ForeignCamera) -> float:
    width, height = camera.image_size_px
    x, y = np.linspace(-0.5, width - 0.5, 257), np.linspace(-0.5, height - 0.5, 257)
    sides = [
        (x, 0 * y - 0.5),
        (x, 0 * y + height - 0.5),
        (0 * x - 0.5, y),
        (0 * x + width - 0.5, y),
    ]
    border = np.concatenate([np.stack(side, axis=-1) for side in sides])
    directions, valid = camera.model.unproject(border)
    limit = min(camera.model.limit_angle_rad, np.pi)
    if not np.all(valid):
        return float(limit)
    across = np.hypot(directions[:, 0], directions[:, 1])
    angles = np.arctan2(across, directions[:, 2] * camera.model.axis_z)
    return float(min(angles.max(), limit))


def numbers(values: Any, count: int, what: str) -> tuple[float, ...]:
    """Return `count` floats of a list.

    Raises
    ------
    InputError
        If `values` is another thing, of another length, or beyond what any camera has.
    """
    good = isinstance(values, Sequence) and not isinstance(values, str) and len(values) == count
    if not good or not all(isinstance(each, int | float) for each in values):
        raise InputError(f"{what}: wanted {count} numbers, got {str(values)[:80]}")
    if not all(abs(each) <= LARGEST for each in values):
        raise InputError(f"{what}: wanted numbers up to {LARGEST:g}, got {str(values)[:80]}")
    return tuple(float(each) for each in values)


def picture_size(width: Any, height: Any) -> tuple[int, int]:
    """Return the size (width, height) in pixels, InputError unless both are whole and positive."""
    pair = numbers([width, height], 2, "picture size")
    if any(side < 1 or side != int(side) for side in pair):
        raise InputError(f"picture size: wanted whole numbers of pixels, got {width} × {height}")
    return int(pair[0]), int(pair[1])


def chosen(cameras: Mapping[str, Any], camera: str) -> tuple[str, Any]:
    """Return the name and content of the camera that is asked for, or of the only one.

    Raises
    ------
    InputError
        If there are several and none is named, or none has the name.
    """
    if not cameras:
        raise InputError("the file holds no camera")
    if camera:
        if camera not in cameras:
            raise InputError(f"no camera {camera!r}; the file holds {', '.join(cameras)}")
        return camera, cameras[camera]
    if len(cameras) > 1:
        raise InputError(f"the file holds {', '.join(cameras)}: choose one with --camera")
    return next(iter(cameras.items()))


def kannala_brandt(
    focal_px: tuple[float, float], centre_px: tuple[float, float], k: Sequence[float]
) -> KannalaBrandt:
    """Return the model of OpenCV's fisheye terms, with one focal length if both are the same."""
    k1, k2, k3, k4 = k
    return KannalaBrandt(centre_px, focal_of(*focal_px), k1, k2, k3, k4)


def as_kannala_brandt(calibration: Calibration) -> KannalaBrandt:
    """Return the lens as a Kannala-Brandt one if it is such a lens exactly.

    Raises
    ------
    NoCounterpart
        If it is not.
    """
    model = calibration.model
    if isinstance(model, Equidistant):
        return KannalaBrandt(model.centre_px, model.focal_px)
    if not isinstance(model, KannalaBrandt):
        raise NoCounterpart(calibration, "kannala_brandt and equidistant")
    return model


def focal_of(fx: float, fy: float) -> float | tuple[float, float]:
    """Return one number for square pixels, (fx, fy) for others."""
    return fx if fx == fy else (fx, fy)


def focal_pair(focal_px: float | tuple[float, float]) -> tuple[float, float]:
    """Return (fx, fy)."""
    fx, fy = np.broadcast_to(np.asarray(focal_px, np.float64), 2).tolist()
    return fx, fy
