"""mrcal's .cameramodel: STEREOGRAPHIC, LONLAT, and SPLINED_STEREOGRAPHIC, which is approximated.

Pixels have integers at their centres, as here. The pose and the optimisation's inputs are left out.
Source : mrcal, "Lens models" and "Camera model"; the file is a literal of Python.
Fails  : mrcal's other models are perspective ones with many terms (OPENCV4 to OPENCV12, CAHVOR,
CAHVORE), of which none is here.
"""

import ast
import re
from typing import Any, cast

import numpy as np

from calibration.camera import Calibration, CameraModel
from calibration.formats.foreign import (
    ForeignCamera,
    NoCounterpart,
    focal_of,
    focal_pair,
    numbers,
    picture_size,
)
from calibration.formats.splined_stereographic import SplinedStereographic
from calibration.models.equirectangular import Equirectangular
from calibration.models.stereographic import Stereographic
from capture.errors import InputError

_MODELS: dict[str, type[Stereographic] | type[Equirectangular]] = {
    "LENSMODEL_STEREOGRAPHIC": Stereographic,
    "LENSMODEL_LONLAT": Equirectangular,
}
_OUTLINE, _RADII = 64, 500
_SPLINED = re.compile(
    r"LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=(\d{1,3})_Ny=(\d{1,3})_fov_x_deg=(\d{1,3})"
)


def recognises(text: str) -> bool:
    """Whether a file may be a .cameramodel."""
    return "LENSMODEL_" in text


def read(text: str, camera: str) -> ForeignCamera:
    """Return the camera of a file; raises InputError if its model is another."""
    if camera:
        raise InputError("such a file holds one camera: leave out --camera")
    content = _literal(text)
    name = str(content.get("lensmodel") or content.get("lens_model"))
    splined = _SPLINED.fullmatch(name)
    if name not in _MODELS and splined is None:
        raise InputError(
            f"{name} has no exact counterpart here; readable are {', '.join(_MODELS)} and "
            "LENSMODEL_SPLINED_STEREOGRAPHIC of order 3, which mrcal-convert-lensmodel makes of it"
        )
    columns, rows, fov_x_deg = map(int, splined.groups()) if splined else (0, 0, 0)
    intrinsics = numbers(content.get("intrinsics"), 4 + 2 * rows * columns, "intrinsics")
    fx, fy, cx, cy, *corrections = intrinsics
    size_px = picture_size(*numbers(content.get("imagersize"), 2, "imagersize"))
    if splined is None:
        return ForeignCamera(_MODELS[name]((cx, cy), focal_of(fx, fy)), size_px)
    surface = np.reshape(corrections, (rows, columns, 2))
    model = SplinedStereographic((cx, cy), (fx, fy), fov_x_deg, surface)
    return ForeignCamera(cast("CameraModel", model), size_px)  # all but the Jacobians


def write(calibration: Calibration) -> str:
    """Return a .cameramodel at the origin; raises NoCounterpart."""
    model = calibration.model
    if not isinstance(model, Stereographic | Equirectangular | SplinedStereographic):
        raise NoCounterpart(calibration, "stereographic and equirectangular")
    values = [*focal_pair(model.focal_px), *model.centre_px]
    if isinstance(model, SplinedStereographic):
        rows, columns = model.corrections.shape[:2]
        name = f"LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx={columns}_Ny={rows}"
        name += f"_fov_x_deg={model.fov_x_deg}"
        values += model.corrections.ravel().tolist()
    else:
        name = next(each for each, known in _MODELS.items() if type(model) is known)
    return (
        f"{{\n    'lensmodel': '{name}',\n    'intrinsics': {values},\n"
        "    'extrinsics': [0, 0, 0, 0, 0, 0],\n"
        f"    'imagersize': {list(calibration.image_size_px)},\n"
        f"    'valid_intrinsics_region': {_valid_region(calibration)},\n}}\n"
    )


def _valid_region(calibration: Calibration) -> list[list[float]]:
    """Return the outline, closed, of the pixels for which the calibration holds."""
    centre, _ = calibration.model.project(np.array([0.0, 0.0, 1.0]))
    azimuth = np.linspace(0.0, 2 * np.pi, _OUTLINE, endpoint=False)
    outward = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    radii_px = np.linspace(0.0, np.hypot(*calibration.image_size_px), _RADII)
    pixels = centre + radii_px[:, None, None] * outward
    _, seen = calibration.unproject(pixels)
    last = np.where(seen, np.arange(_RADII)[:, None], 0).max(axis=0)
    outline = pixels[last, np.arange(_OUTLINE)].round(2).tolist()
    return [*outline, outline[0]]


def _literal(text: str) -> dict[str, Any]:
    try:
        content = ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError, TypeError):
        content = None
    if not isinstance(content, dict):
        raise InputError("wanted a dictionary of mrcal's, with lensmodel, intrinsics, imagersize")
    return content
