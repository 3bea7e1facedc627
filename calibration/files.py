"""Calibration files: one camera as JSON, simple enough to be written by hand from a data sheet.

Input  : {"model": "equisolid", "image_size_px": [5616, 3744], "centre_px": [2807.5, 1871.5],
          "focal_px": 1248, "valid_angle_rad": 1.6232}, the model's other parameters by name, and
         optionally R_world_camera, image_circle {centre_px, radius_px}, vignetting [v1, …],
         uneven_vignetting, reflectance, inner_angle_rad, and what `fishlight calibrate` made it
         from: lens_fit (calibration/lens/record.py), vignetting_fit
         (calibration/vignetting_record.py) and ball_fit (calibration/ball_record.py).
Output : Calibration, or InputError in one line that names the file and the key.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
import numpy as np

from calibration.camera import LEVEL, Calibration, ImageCircle
from calibration.models import MODELS
from calibration.models.equirectangular import Equirectangular, full_sphere
from calibration.models.parameters import LARGEST, check_parameters
from capture.errors import InputError
from capture.files import read_bytes
from capture.manifest import Pixels
from capture.output import write_text

_MAX_BYTES = 2**24
"""Largest calibration file that is read."""

_RECORDS = ("lens_fit", "vignetting_fit", "ball_fit")
"""Keys that tell what a calibration was made from."""

_Number = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)]
_Row = tuple[_Number, _Number, _Number]
_Record = TypeVar("_Record")


class _Circle(msgspec.Struct, forbid_unknown_fields=True):
    centre_px: tuple[_Number, _Number]
    radius_px: _Number


class _Camera(msgspec.Struct):
    """The keys of a calibration file that do not belong to the model."""

    image_size_px: tuple[Pixels, Pixels]
    valid_angle_rad: _Number
    R_world_camera: tuple[_Row, _Row, _Row] | None = None
    image_circle: _Circle | None = None
    vignetting: tuple[_Number, ...] = ()
    uneven_vignetting: tuple[_Number, ...] = ()
    reflectance: tuple[_Number, ...] = ()
    inner_angle_rad: _Number = 0.0
    lens_fit: dict[str, Any] | None = None
    vignetting_fit: dict[str, Any] | None = None
    ball_fit: dict[str, Any] | None = None


def read_calibration(path: Path) -> Calibration:
    """Return the camera that a calibration file describes.

    Raises
    ------
    InputError
        If the file cannot be read, a key is unknown or missing, or a value has the wrong type or
        is out of range; above a full turn the message supposes that degrees were meant.
    """
    content = read_object(path)
    name = content.pop("model", None)
    if not isinstance(name, str) or name not in MODELS:
        raise InputError(f'{path}: "model" must be one of {", ".join(MODELS)}; got {name!r}')
    model_type = MODELS[name]
    camera_keys = set(_Camera.__struct_fields__)
    model_keys = {field.name for field in fields(model_type)}
    unknown = sorted(content.keys() - camera_keys - model_keys)
    if unknown:
        known = ["model", *sorted(model_keys), *sorted(camera_keys)]
        raise InputError(f'{path}: unknown key "{unknown[0]}"; known are {", ".join(known)}')
    own = {key: value for key, value in content.items() if key in camera_keys}
    camera: _Camera = _convert(path, own, _Camera)
    if camera.valid_angle_rad > 2 * np.pi:
        raise InputError(
            f"{path}: valid_angle_rad must be in (0, π], got {camera.valid_angle_rad}; "
            f"if those are degrees, write {np.deg2rad(camera.valid_angle_rad):.4f}"
        )
    parameters = {key: value for key, value in content.items() if key in model_keys}
    if model_type is Equirectangular and not parameters:
        model = full_sphere(camera.image_size_px)
    else:
        model = _convert(path, parameters, model_type)
    rotation = LEVEL if camera.R_world_camera is None else np.array(camera.R_world_camera)
    circle = camera.image_circle
    try:
        check_parameters(model)
        return Calibration(
            model=model,
            image_size_px=camera.image_size_px,
            valid_angle_rad=camera.valid_angle_rad,
            R_world_camera=rotation,
            image_circle=None
            if circle is None
            else ImageCircle(circle.centre_px, circle.radius_px),
            vignetting=camera.vignetting,
            uneven_vignetting=camera.uneven_vignetting,
            reflectance=camera.reflectance,
            inner_angle_rad=camera.inner_angle_rad,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def write_calibration(
    path: Path,
    calibration: Calibration,
    *,
    lens_fit: msgspec.Struct | Mapping[str, Any] | None = None,
    vignetting_fit: msgspec.Struct | Mapping[str, Any] | None = None,
    ball_fit: msgspec.Struct | Mapping[str, Any] | None = None,
    force: bool = True,
) -> None:
    """Write a calibration file that `read_calibration` reads back exactly, a key a line."""
    circle = calibration.image_circle
    content: dict[str, Any] = {
        "model": calibration.model.name,
        "image_size_px": calibration.image_size_px,
        **asdict(calibration.model),
        "valid_angle_rad": calibration.valid_angle_rad,
        "R_world_camera": calibration.R_world_camera,
    }
    if circle is not None:
        content["image_circle"] = asdict(circle)
    if calibration.vignetting:
        content["vignetting"] = calibration.vignetting
    if calibration.uneven_vignetting:
        content["uneven_vignetting"] = calibration.uneven_vignetting
    if calibration.reflectance:
        content["reflectance"] = calibration.reflectance
    if calibration.inner_angle_rad:
        content["inner_angle_rad"] = calibration.inner_angle_rad
    records = zip(_RECORDS, (lens_fit, vignetting_fit, ball_fit), strict=True)
    content |= {name: record for name, record in records if record is not None}
    lines = [
        f'  "{key}": {msgspec.json.encode(value, enc_hook=_plain).decode()}'
        for key, value in content.items()
    ]
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n", force=force)


def read_records(path: Path) -> dict[str, Any]:
    """Return what a file keeps of its making: keyword arguments of `write_calibration`."""
    content = read_object(path)
    return {name: content[name] for name in _RECORDS if name in content}


def read_record(path: Path, key: str, kind: type[_Record]) -> _Record | None:
    """Return what a file keeps under `key` of its making; None if nothing.

    Raises
    ------
    InputError
        If what the file keeps was altered.
    """
    content = read_object(path).get(key)
    try:
        return None if content is None else msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {key}: {error}") from None


def read_object(path: Path) -> dict[str, Any]:
    """Return the keys of a calibration file as they stand; InputError if it is not JSON."""
    content = read_bytes(path, _MAX_BYTES)
    try:
        return msgspec.json.decode(content, type=dict[str, Any])
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not a calibration file in JSON: {error}") from None


def _convert(path: Path, values: dict[str, Any], wanted: type[Any]) -> Any:
    try:
        return msgspec.convert(values, wanted)
    except (msgspec.ValidationError, OverflowError) as error:
        raise InputError(f"{path}: {error}") from None


def _plain(value: Any) -> Any:
    """Return a numpy number or array as what JSON knows."""
    return value.tolist()
