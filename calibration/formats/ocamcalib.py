"""OCamCalib's calib_results.txt: Scaramuzza's polynomial.

The file counts rows before columns, from 0 at the centre of a pixel, and writes the height before
the width. Its second polynomial, from angle to radius, approximates the inverse of the first: it is
written, for programs that need it, and not read.
Source : the OCamCalib toolbox, D. Scaramuzza: the files that it exports and the functions cam2world
and world2cam of its code in C.
"""

import numpy as np
from numpy.polynomial import Polynomial

from calibration.camera import Calibration
from calibration.formats.foreign import ForeignCamera, NoCounterpart, focal_pair, picture_size
from calibration.models.ocam import OCam, from_ocamcalib
from capture.errors import InputError

_INVERSE_TERMS = range(6, 17)
_INVERSE_ERROR_PX = 0.01
"""The second polynomial has as few terms as keep its error below, or the most of these."""


def recognises(text: str) -> bool:
    """Whether a file may be a calib_results.txt."""
    return "#polynomial" in text


def read(text: str, camera: str) -> ForeignCamera:
    """Return the camera of a file; raises InputError if it is not one of the toolbox's."""
    if camera:
        raise InputError("such a file holds one camera: leave out --camera")
    rows = [line.split() for line in text.splitlines() if line.strip() and line.strip()[0] != "#"]
    try:
        direct, _, centre, affine, size = ([float(word) for word in row] for row in rows)
        (row, column), (c, d, e), (height, width) = centre, affine, size
    except ValueError:
        raise InputError(
            "wanted five lines of numbers: both polynomials, centre, c d e, height and width"
        ) from None
    if len(direct) < 3 or len(direct) != direct[0] + 1:
        raise InputError(f"the polynomial has {len(direct) - 1} numbers, it says {direct[:1]}")
    model = from_ocamcalib(tuple(direct[1:]), (row, column), c, d, e)
    return ForeignCamera(model, picture_size(width, height))


def write(calibration: Calibration) -> str:
    """Return a calib_results.txt; raises NoCounterpart."""
    model = calibration.model
    if not isinstance(model, OCam):
        raise NoCounterpart(calibration, "ocam")
    fx, fy = focal_pair(model.focal_px)
    terms = [1.0, 0.0, *model.coefficients]
    direct = [0.0 - term * fx ** (1 - order) for order, term in enumerate(terms)]
    (column, row), (width, height) = model.centre_px, calibration.image_size_px
    affine = [model.c * fy / fx, model.d * fy / fx, model.e]
    blocks: dict[str, list[float]] = {
        "polynomial coefficients for the DIRECT mapping function": [len(direct), *direct],
        "polynomial coefficients for the inverse mapping function": _inverse(
            model, fx, calibration.valid_angle_rad
        ),
        'center: "row" and "column", starting from 0 (C convention)': [row, column],
        'affine parameters "c", "d", "e"': affine,
        'image size: "height" and "width"': [height, width],
    }
    return "\n\n".join(f"#{name}\n\n{_words(values)}" for name, values in blocks.items()) + "\n"


def _words(values: list[float]) -> str:
    return " ".join(repr(value) for value in values)


def _inverse(model: OCam, focal_px: float, valid_angle_rad: float) -> list[float]:
    """Return the count and terms of the radius in pixels over the toolbox's angle.

    Up to the valid angle. The toolbox measures from the plane through the camera across the axis:
    −π/2 is on the axis.
    """
    angles = np.linspace(0.0, min(valid_angle_rad, 0.999 * model.limit_angle_rad), 512)
    rays = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
    round_lens = OCam((0.0, 0.0), focal_px, model.coefficients)
    radius_px = round_lens.project(rays)[0][:, 0]
    angle_rad = angles - np.pi / 2
    for count in _INVERSE_TERMS:
        fit = Polynomial.fit(angle_rad, radius_px, count - 1).convert()
        terms = np.asarray(fit.coef, np.float64)
        error = np.abs(Polynomial(terms)(angle_rad) - radius_px).max()
        if error < _INVERSE_ERROR_PX:
            break
    return [len(terms), *terms.tolist()]
