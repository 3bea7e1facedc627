"""COLMAP's cameras.txt: OPENCV_FISHEYE and its shorter forms.

COLMAP's pixels have their centres at +½: the middle of the upper left one is (0.5, 0.5).
Source : the documentation of COLMAP, "Output Format" and "Camera Models".
Fails  : COLMAP itself uses no direction from 90° on.
"""

from calibration.camera import Calibration
from calibration.formats.foreign import (
    ForeignCamera,
    as_kannala_brandt,
    chosen,
    focal_pair,
    kannala_brandt,
    picture_size,
)
from capture.errors import InputError

_HALF = 0.5

_FISHEYES = {"OPENCV_FISHEYE": 8, "RADIAL_FISHEYE": 5, "SIMPLE_RADIAL_FISHEYE": 4}
"""Models that can be read, and how many parameters they have."""

_OTHERS = ("PINHOLE", "RADIAL", "OPENCV", "FISHEYE", "FOV")


def recognises(text: str) -> bool:
    """Whether a file may be a cameras.txt."""
    return any(
        len(words) > 4 and words[0].isdecimal() and any(name in words[1] for name in _OTHERS)
        for words in map(str.split, text.splitlines())
    )


def read(text: str, camera: str) -> ForeignCamera:
    """Return the camera of a number; raises InputError if it is no fisheye that is known."""
    rows = [line.split() for line in text.splitlines() if line.strip() and line.strip()[0] != "#"]
    number, words = chosen({row[0]: row[1:] for row in rows}, camera)
    kind = words[0] if words else ""
    if kind not in _FISHEYES:
        raise InputError(f"camera {number} is {kind}; readable are {', '.join(_FISHEYES)}")
    try:
        width, height, *values = (float(word) for word in words[1:])
    except ValueError:
        raise InputError(f"camera {number}: wanted width, height and parameters") from None
    if len(values) != _FISHEYES[kind]:
        raise InputError(
            f"camera {number}: {kind} has {_FISHEYES[kind]} parameters, got {len(values)}"
        )
    if kind != "OPENCV_FISHEYE":
        values = [values[0], *values, *[0.0] * (7 - len(values))]
    fx, fy, cx, cy, *terms = values
    model = kannala_brandt((fx, fy), (cx - _HALF, cy - _HALF), terms)
    return ForeignCamera(model, picture_size(width, height))


def write(calibration: Calibration) -> str:
    """Return a cameras.txt of one camera, number 1; raises NoCounterpart."""
    lens = as_kannala_brandt(calibration)
    (fx, fy), (cx, cy) = focal_pair(lens.focal_px), lens.centre_px
    width, height = calibration.image_size_px
    values = [fx, fy, cx + _HALF, cy + _HALF, lens.k1, lens.k2, lens.k3, lens.k4]
    return (
        "# Camera list with one line of data per camera:\n"
        "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
        "# Number of cameras: 1\n"
        f"1 OPENCV_FISHEYE {width} {height} {' '.join(map(repr, values))}\n"
    )
