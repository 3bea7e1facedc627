"""Camera matrix and distortion as OpenCV's FileStorage writes them: fisheye and omnidir.

OpenCV stores no name of a model. It is told by `xi` (omnidir), by a line `model: fisheye`, which is
written here, or by `distortion_model: equidistant`, as in ROS's camera_info.
Source : OpenCV, documentation of the modules fisheye and ccalib (omnidir).
Fails  : cv2.fisheye itself mirrors directions past 90°; the file holds them right. Skew has no
counterpart here.
"""

from typing import Any

from calibration.camera import Calibration
from calibration.formats.foreign import (
    ForeignCamera,
    NoCounterpart,
    as_kannala_brandt,
    focal_of,
    focal_pair,
    kannala_brandt,
    numbers,
    picture_size,
)
from calibration.formats.yaml_text import parse_yaml
from calibration.models.unified import Unified
from capture.errors import InputError

_MATRIX = ("camera_matrix", "K", "cameraMatrix", "intrinsic_matrix", "camera_matrix_1", "M")
_DISTORTION = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs", "distortion")
_WIDTH = ("image_width", "width", "img_width")
_HEIGHT = ("image_height", "height", "img_height")
_XI = ("xi", "Xi")
_MODEL = ("model", "camera_model", "distortion_model")
_FISHEYE = ("fisheye", "equidistant", "kannala_brandt", "opencv_fisheye")


def recognises(text: str) -> bool:
    """Whether a file may come from OpenCV."""
    return "opencv-matrix" in text or any(f"{name}:" in text for name in _MATRIX[:3])


def read(text: str, camera: str) -> ForeignCamera:
    """Return the camera of a file; raises InputError if it is not a fisheye or omnidir one."""
    content = parse_yaml(text)
    if not isinstance(content, dict):
        raise InputError("wanted a camera matrix and distortion by name")
    if camera:
        raise InputError("such a file holds one camera: leave out --camera")
    fx, skew, cx, zero, fy, cy, *last = numbers(_plain(_named(content, _MATRIX)), 9, "matrix")
    if (zero, *last) != (0.0, 0.0, 0.0, 1.0):
        raise InputError("the camera matrix must be [fx 0 cx; 0 fy cy; 0 0 1]")
    if skew != 0:
        raise InputError(
            f"the camera matrix has a skew of {skew}, which has no exact counterpart here: "
            "calibrate with the skew fixed (CALIB_FIX_SKEW)"
        )
    size = _size(content)
    distortion = _plain(_named(content, _DISTORTION))
    xi = _plain(_named(content, _XI, needed=False))
    name = str(_named(content, _MODEL, needed=False) or "").lower()
    if xi is not None:
        (shift,) = numbers(xi if isinstance(xi, list) else [xi], 1, "xi")
        terms = numbers(distortion, 4, "distortion of omnidir")
        return ForeignCamera(Unified((cx, cy), focal_of(fx, fy), shift, *terms), size)
    if name in _FISHEYE:
        terms = numbers(distortion, 4, "distortion of fisheye")
        return ForeignCamera(kannala_brandt((fx, fy), (cx, cy), terms), size)
    if name or not isinstance(distortion, list) or len(distortion) != 4:
        kind = name or "of a perspective lens"
        raise InputError(f"the model is {kind}, of which there is no exact counterpart here")
    raise InputError(
        "the file does not tell whose distortion its four numbers are: if they are of "
        'cv2.fisheye, add a line "model: fisheye"'
    )


def write(calibration: Calibration) -> str:
    """Return a file that cv2.FileStorage reads; raises NoCounterpart."""
    model = calibration.model
    if isinstance(model, Unified):
        name, terms = "omnidir", [model.k1, model.k2, model.p1, model.p2]
    else:
        try:
            model = as_kannala_brandt(calibration)
        except NoCounterpart:
            known = "kannala_brandt, equidistant and unified"
            raise NoCounterpart(calibration, known) from None
        name, terms = "fisheye", [model.k1, model.k2, model.k3, model.k4]
    (fx, fy), (cx, cy) = focal_pair(model.focal_px), model.centre_px
    width, height = calibration.image_size_px
    parts = [
        f"%YAML:1.0\n---\nmodel: {name}\nimage_width: {width}\nimage_height: {height}\n",
        _matrix("camera_matrix", 3, 3, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        _matrix("distortion_coefficients", 1, 4, terms),
    ]
    if isinstance(model, Unified):
        parts.append(_matrix("xi", 1, 1, [model.xi]))
    return "".join(parts)


def _matrix(name: str, rows: int, columns: int, values: list[float]) -> str:
    return (
        f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n"
        f"   data: {values}\n"
    )


def _named(content: dict[str, Any], names: tuple[str, ...], *, needed: bool = True) -> Any:
    for name in names:
        if name in content:
            return content[name]
    if needed:
        raise InputError(f"wanted a key {' or '.join(names[:3])}; there is {', '.join(content)}")
    return None


def _plain(value: Any) -> Any:
    """Return the numbers of a matrix, however nested."""
    if isinstance(value, dict) and "data" in value:
        return value["data"]
    if isinstance(value, list) and all(isinstance(row, list) for row in value):
        return [number for row in value for number in row]
    return value


def _size(content: dict[str, Any]) -> tuple[int, int]:
    size = content.get("image_size") or content.get("size")
    if isinstance(size, list) and len(size) == 2:
        return picture_size(*size)
    return picture_size(_named(content, _WIDTH), _named(content, _HEIGHT))
