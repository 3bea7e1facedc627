"""mrcal's .cameramodel: LENSMODEL_STEREOGRAPHIC and LENSMODEL_LONLAT.

Pixels have integers at their centres, as here. The pose and the optimisation's inputs are left out.
Source : mrcal, "Lens models" and "Camera model"; the file is a literal of Python.
Fails  : mrcal's other models are perspective ones with many terms (OPENCV4 to OPENCV12, CAHVOR,
CAHVORE) or a surface of corrections (SPLINED_STEREOGRAPHIC), which no model here follows exactly.
"""

import ast
from typing import Any

from calibration.camera import Calibration
from calibration.formats.foreign import (
    ForeignCamera,
    NoCounterpart,
    focal_of,
    focal_pair,
    numbers,
    picture_size,
)
from calibration.models.equirectangular import Equirectangular
from calibration.models.stereographic import Stereographic
from capture.errors import InputError

_MODELS: dict[str, type[Stereographic] | type[Equirectangular]] = {
    "LENSMODEL_STEREOGRAPHIC": Stereographic,
    "LENSMODEL_LONLAT": Equirectangular,
}


def recognises(text: str) -> bool:
    """Whether a file may be a .cameramodel."""
    return "LENSMODEL_" in text


def read(text: str, camera: str) -> ForeignCamera:
    """Return the camera of a file; raises InputError if its model is another."""
    if camera:
        raise InputError("such a file holds one camera: leave out --camera")
    content = _literal(text)
    name = str(content.get("lensmodel") or content.get("lens_model"))
    if name not in _MODELS:
        raise InputError(
            f"{name} has no exact counterpart here; readable are {', '.join(_MODELS)}, which "
            "mrcal-convert-lensmodel can make of others with an error that it prints"
        )
    fx, fy, cx, cy = numbers(list(content.get("intrinsics", ())), 4, "intrinsics")
    width, height = numbers(list(content.get("imagersize", ())), 2, "imagersize")
    return ForeignCamera(_MODELS[name]((cx, cy), focal_of(fx, fy)), picture_size(width, height))


def write(calibration: Calibration) -> str:
    """Return a .cameramodel at the origin; raises NoCounterpart."""
    model = calibration.model
    names = [name for name, known in _MODELS.items() if type(model) is known]
    if not names or not isinstance(model, Stereographic | Equirectangular):
        raise NoCounterpart(calibration, "stereographic and equirectangular")
    values = [*focal_pair(model.focal_px), *model.centre_px]
    return (
        f"{{\n    'lensmodel': '{names[0]}',\n    'intrinsics': {values},\n"
        "    'extrinsics': [0, 0, 0, 0, 0, 0],\n"
        f"    'imagersize': {list(calibration.image_size_px)},\n}}\n"
    )


def _literal(text: str) -> dict[str, Any]:
    try:
        content = ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError, TypeError):
        content = None
    if not isinstance(content, dict):
        raise InputError("wanted a dictionary of mrcal's, with lensmodel, intrinsics, imagersize")
    return content
