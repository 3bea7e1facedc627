"""The camera of nerfstudio's transforms.json: OPENCV_FISHEYE, for all frames alike.

Its pixels have their centres at +½, as its `Cameras.get_image_coords` has it. A file that is
written holds no frames: their poses come from elsewhere.
"""

from typing import Any

import msgspec

from calibration.camera import Calibration
from calibration.formats.foreign import (
    ForeignCamera,
    as_kannala_brandt,
    focal_pair,
    kannala_brandt,
    numbers,
    picture_size,
)
from capture.errors import InputError

_HALF = 0.5

_KEYS = ("fl_x", "fl_y", "cx", "cy")
_TERMS = ("k1", "k2", "k3", "k4")


def recognises(text: str) -> bool:
    """Whether a file may be a transforms.json."""
    return text.lstrip().startswith("{") and '"fl_x"' in text


def read(text: str, camera: str) -> ForeignCamera:
    """Return the camera that all frames share; raises InputError if it is no fisheye."""
    if camera:
        raise InputError("such a file holds one camera: leave out --camera")
    try:
        content = msgspec.json.decode(text, type=dict[str, Any])
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError(f"not JSON: {error}") from None
    missing = [key for key in (*_KEYS, "w", "h") if key not in content]
    if missing:
        raise InputError(
            f"wanted a key {missing[0]} beside the frames; cameras that differ from frame to "
            "frame cannot be read"
        )
    kind = content.get("camera_model", "OPENCV")
    if kind != "OPENCV_FISHEYE":
        raise InputError(f"camera_model is {kind}; readable is OPENCV_FISHEYE")
    for key in ("p1", "p2"):
        if content.get(key, 0.0) != 0.0:
            raise InputError(f"{key} is {content[key]}: a fisheye here has no tangential terms")
    fx, fy, cx, cy = numbers([content[key] for key in _KEYS], 4, ", ".join(_KEYS))
    terms = numbers([content.get(key, 0.0) for key in _TERMS], 4, ", ".join(_TERMS))
    model = kannala_brandt((fx, fy), (cx - _HALF, cy - _HALF), terms)
    return ForeignCamera(model, picture_size(content["w"], content["h"]))


def write(calibration: Calibration) -> str:
    """Return a transforms.json without frames; raises NoCounterpart."""
    lens = as_kannala_brandt(calibration)
    (fx, fy), (cx, cy) = focal_pair(lens.focal_px), lens.centre_px
    width, height = calibration.image_size_px
    content = {
        "camera_model": "OPENCV_FISHEYE",
        "w": width,
        "h": height,
        "fl_x": fx,
        "fl_y": fy,
        "cx": cx + _HALF,
        "cy": cy + _HALF,
        **{term: getattr(lens, term) for term in _TERMS},
        "frames": [],
    }
    return msgspec.json.format(msgspec.json.encode(content), indent=2).decode() + "\n"
