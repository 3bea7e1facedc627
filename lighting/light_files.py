"""lights.json: a light set as text that other programs can read and write.

One object with `schema`, `coordinate_frame`, `colour_space`, `scale`, `source`, `timestamp_s`,
`clipped_fraction`, `predicted_error`, `block_rows`, `fill` (nine coefficients of three channels,
see harmonics.py; empty for none) and `lights`, each with `direction`, `irradiance`,
`angular_radius_rad`, `is_key` and `shadow_map_px`, one a line. Only `lights` with directions and
irradiances must be there, for files written by hand; what is there must say what fishlight means by
it. Unknown keys are ignored. Numbers are written with as many digits as bring every bit back.
"""

import math
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from capture.errors import InputError
from capture.files import read_bytes
from capture.output import write_text
from capture.radiance import RELATIVE, check_scale
from lighting.light_set import LightSet
from lighting.sphere import harmonics

_MAX_BYTES = 2**26
"""Largest file that is read: about 300,000 lights."""

_FORMAT = "fishlight-lights"
_MAJOR = "1"
_COORDINATE_FRAME = (
    "world: right-handed, +Y up, metres; directions point from the scene toward the light"
)
_COLOUR_SPACE = "linear Rec.709"
_UNIT_TOLERANCE = 1e-3  # more is not rounding
_EXACT = 1e-12  # less is what float64 leaves, and is kept bit for bit

_NotNegative = Annotated[float, Meta(ge=0)]


class _Light(msgspec.Struct, frozen=True):
    direction: tuple[float, float, float]
    irradiance: tuple[_NotNegative, _NotNegative, _NotNegative]
    angular_radius_rad: Annotated[float, Meta(ge=0, le=np.pi)] = 0.0
    is_key: bool = False
    shadow_map_px: int | None = None  # a suggestion, worked out anew from the radius when read


class _LightFile(msgspec.Struct, frozen=True, kw_only=True):
    schema: str = f"{_FORMAT}/{_MAJOR}"
    coordinate_frame: str = _COORDINATE_FRAME
    colour_space: str = _COLOUR_SPACE
    scale: str = RELATIVE
    source: str = ""
    timestamp_s: float = 0.0
    clipped_fraction: Annotated[float, Meta(ge=0, le=1)] = 0.0
    predicted_error: _NotNegative | None = None
    block_rows: int | None = None
    fill: tuple[tuple[float, float, float], ...] = ()
    lights: tuple[_Light, ...]


def read_lights(path: Path) -> LightSet:
    """Return the lights of a lights.json file.

    Directions that are unit vectors up to rounding (1e-3) are brought to unit length.

    Raises
    ------
    InputError
        If the file cannot be read, is not lights.json of schema 1, uses another coordinate frame
        or colour space, a light has a direction that is no unit vector or negative irradiance, or
        the fill is negative somewhere.
    """
    content = read_bytes(path, _MAX_BYTES)
    try:
        file = msgspec.json.decode(content, type=_LightFile)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not a lights.json file: {error}") from error
    _check_header(path, file)

    directions = np.array([light.direction for light in file.lights]).reshape(-1, 3)
    irradiance = np.array([light.irradiance for light in file.lights]).reshape(-1, 3)
    length = np.array([math.hypot(*light.direction) for light in file.lights])
    for index in np.flatnonzero(np.abs(length - 1) > _UNIT_TOLERANCE):
        raise InputError(
            f"{path}: the direction of light {index} must be a unit vector, "
            f"its length is {length[index]:.6g}"
        )
    fill = np.array(file.fill, np.float64).reshape(-1, 3)
    if len(fill) not in (0, harmonics.COUNT):
        raise InputError(f"{path}: fill must hold {harmonics.COUNT} coefficients, got {len(fill)}")
    fill = fill if len(fill) else np.zeros((harmonics.COUNT, 3))
    unit = np.where(np.abs(length - 1) > _EXACT, length, 1.0)
    try:
        return LightSet(
            directions / unit[:, None],
            irradiance,
            np.array([light.angular_radius_rad for light in file.lights]),
            timestamp_s=file.timestamp_s,
            clipped_fraction=file.clipped_fraction,
            scale=file.scale,
            source=file.source,
            is_key=np.array([light.is_key for light in file.lights], np.bool_),
            fill=fill,
            predicted_error=file.predicted_error,
            block_rows=file.block_rows,
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def write_lights(path: Path, lights: LightSet, *, force: bool = False) -> None:
    """Write `lights` to `path` as lights.json, whole or not at all.

    Raises
    ------
    InputError
        If the file exists and `force` is not set, or its folder does not.
    """
    write_text(path, _to_text(_file_of(lights)), force=force)


def lights_object(lights: LightSet) -> dict[str, Any]:
    """Return what lights.json holds of `lights`, as the object that JSON makes of it."""
    held: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(_file_of(lights)))
    return held


def _file_of(lights: LightSet) -> _LightFile:
    arrays = (
        lights.directions,
        lights.irradiance,
        lights.angular_radius_rad,
        lights.is_key,
        lights.shadow_map_px,
    )
    return _LightFile(
        scale=lights.scale,
        source=lights.source,
        timestamp_s=lights.timestamp_s,
        clipped_fraction=lights.clipped_fraction,
        predicted_error=lights.predicted_error,
        block_rows=lights.block_rows,
        fill=tuple(map(tuple, lights.fill.tolist())) if lights.fill.any() else (),
        lights=tuple(
            _Light(tuple(direction), tuple(irradiance), *rest)
            for direction, irradiance, *rest in zip(*(a.tolist() for a in arrays), strict=True)
        ),
    )


def _check_header(path: Path, file: _LightFile) -> None:
    name, _, version = file.schema.partition("/")
    if name != _FORMAT or version.split(".")[0] != _MAJOR:
        raise InputError(
            f"{path}: its schema must be {_FORMAT}/{_MAJOR}, got {file.schema!r}; "
            "a newer fishlight may read it"
        )
    if not (file.coordinate_frame and _COORDINATE_FRAME.startswith(file.coordinate_frame)):
        raise InputError(
            f"{path}: its coordinate_frame must be {_COORDINATE_FRAME!r}, "
            f"got {file.coordinate_frame!r}; convert the directions"
        )
    if file.colour_space != _COLOUR_SPACE:
        raise InputError(
            f"{path}: its colour_space must be {_COLOUR_SPACE!r}, "
            f"got {file.colour_space!r}; convert the irradiances"
        )
    check_scale(path, file.scale)


def _to_text(file: _LightFile) -> str:
    """Return JSON with one field, and one light, a line."""
    fields = msgspec.structs.asdict(file)
    lights = ",".join(f"\n    {_json(light)}" for light in fields.pop("lights"))
    head = "".join(f'  "{name}": {_json(value)},\n' for name, value in fields.items())
    return f'{{\n{head}  "lights": [{lights}\n  ]\n}}\n'


def _json(value: Any) -> str:
    return msgspec.json.encode(value).decode()
