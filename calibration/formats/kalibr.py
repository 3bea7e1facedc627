"""Kalibr's camchain.yaml: pinhole-equi, omni, omni-radtan, ds and eucm.

Pixels have integers at their centres, as here. Poses between cameras and to an IMU are left out.
Source : ethz-asl/kalibr, wiki, "Yaml formats".
Fails  : pinhole-radtan and pinhole-fov are lenses of less than 180° that no model here is.
"""

from typing import Any

from calibration.camera import Calibration, CameraModel
from calibration.formats.foreign import (
    ForeignCamera,
    NoCounterpart,
    as_kannala_brandt,
    chosen,
    focal_of,
    focal_pair,
    kannala_brandt,
    numbers,
    picture_size,
)
from calibration.formats.yaml_text import parse_yaml
from calibration.models.double_sphere import DoubleSphere
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.unified import Unified
from capture.errors import InputError

_UNDISTORTED = ("none", "", None)


def recognises(text: str) -> bool:
    """Whether a file may be a camchain."""
    return "camera_model:" in text and "intrinsics:" in text


def read(text: str, camera: str) -> ForeignCamera:
    """Return one camera of a camchain; raises InputError if there is none that can be."""
    content = parse_yaml(text)
    if not isinstance(content, dict):
        raise InputError("wanted cameras by name, such as cam0")
    cameras = {
        name: each
        for name, each in content.items()
        if isinstance(each, dict) and "camera_model" in each
    }
    if "camera_model" in content:  # of `kalibr_calibrate_imu_camera`'s input: one, without a name
        cameras = {"cam0": content}
    name, values = chosen(cameras, camera)
    width, height = numbers(values.get("resolution"), 2, f"{name}: resolution")
    return ForeignCamera(_model(values, name), picture_size(width, height))


def write(calibration: Calibration) -> str:
    """Return a camchain of one camera, cam0; raises NoCounterpart."""
    kind, distortion, intrinsics, coefficients = _terms(calibration)
    width, height = calibration.image_size_px
    lines = {
        "camera_model": kind,
        "intrinsics": intrinsics,
        "distortion_model": distortion,
        "distortion_coeffs": coefficients,
        "resolution": [width, height],
    }
    return "cam0:\n" + "".join(f"  {key}: {value}\n" for key, value in lines.items())


def _model(values: dict[str, Any], name: str) -> CameraModel:
    kind, distortion = values.get("camera_model"), values.get("distortion_model")
    given = values.get("intrinsics")
    coefficients = values.get("distortion_coeffs") or []
    is_zero = isinstance(coefficients, list) and not any(coefficients)
    undistorted = distortion in _UNDISTORTED or is_zero
    if kind == "pinhole" and distortion in ("equidistant", "equi"):
        fx, fy, cx, cy = numbers(given, 4, f"{name}: intrinsics")
        return kannala_brandt((fx, fy), (cx, cy), numbers(coefficients, 4, "distortion_coeffs"))
    if kind == "omni" and (undistorted or distortion == "radtan"):
        xi, fx, fy, cx, cy = numbers(given, 5, f"{name}: intrinsics")
        terms = (0.0,) * 4 if undistorted else numbers(coefficients, 4, "distortion_coeffs")
        return Unified((cx, cy), focal_of(fx, fy), xi, *terms)
    if kind == "ds" and undistorted:
        xi, alpha, fx, fy, cx, cy = numbers(given, 6, f"{name}: intrinsics")
        return DoubleSphere((cx, cy), focal_of(fx, fy), xi, alpha)
    if kind == "eucm" and undistorted:
        alpha, beta, fx, fy, cx, cy = numbers(given, 6, f"{name}: intrinsics")
        return ExtendedUnified((cx, cy), focal_of(fx, fy), alpha, beta)
    raise InputError(
        f"{name} is {kind}-{distortion}, of which there is no exact counterpart here; readable are "
        "pinhole-equidistant, omni-none, omni-radtan, ds-none and eucm-none"
    )


def _terms(calibration: Calibration) -> tuple[str, str, list[float], list[float]]:
    """Return the camera and distortion model, intrinsics and distortion coefficients."""
    model = calibration.model
    if isinstance(model, Unified):
        pixels = [*focal_pair(model.focal_px), *model.centre_px]
        terms = [model.k1, model.k2, model.p1, model.p2]
        return "omni", "radtan", [model.xi, *pixels], terms
    if isinstance(model, DoubleSphere):
        pixels = [*focal_pair(model.focal_px), *model.centre_px]
        return "ds", "none", [model.xi, model.alpha, *pixels], []
    if isinstance(model, ExtendedUnified):
        pixels = [*focal_pair(model.focal_px), *model.centre_px]
        return "eucm", "none", [model.alpha, model.beta, *pixels], []
    try:
        lens = as_kannala_brandt(calibration)
    except NoCounterpart:
        known = "kannala_brandt, equidistant, unified, double_sphere and extended_unified"
        raise NoCounterpart(calibration, known) from None
    pixels = [*focal_pair(lens.focal_px), *lens.centre_px]
    return "pinhole", "equidistant", pixels, [lens.k1, lens.k2, lens.k3, lens.k4]
