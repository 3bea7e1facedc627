"""A lens followed as nearly as another model can, for formats that know no better.

Input  : a calibration and the model to fit.
Output : the calibration with that model, and by how many radians it is off.
Fails  : a fit is only as good as its model: look at the error before the file is used.
"""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibration.camera import Calibration, CameraModel
from calibration.formats.splined_stereographic import SplinedStereographic, splined_through
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.ocam import OCam
from calibration.models.parameters import parameters, with_parameters
from capture.errors import InputError

Nearest = type[KannalaBrandt] | type[OCam] | type[SplinedStereographic]

_GRID = 72
"""Pixels along either side that are fitted."""

_OCAM_TERMS = 5

_MISSED_PX = 1e3
"""Residual where a model that is tried has no pixel."""


@dataclass(frozen=True)
class Approximation:
    """A calibration whose lens follows another one's, and the angle between both in its picture.

    `rms_rad` and `max_rad` are over the pixels that the calibration holds for.
    """

    calibration: Calibration
    rms_rad: float
    max_rad: float


def approximate(calibration: Calibration, nearest: Nearest) -> Approximation:
    """Return the calibration with its lens replaced by the nearest one of a model.

    Raises
    ------
    InputError
        If the model can represent some of the directions at best.
    """
    pixels = _seen_pixels(calibration)
    directions, _ = calibration.model.unproject(pixels)
    centre_px, focal_px = _paraxial(calibration)
    if issubclass(nearest, SplinedStereographic):
        splined = splined_through(directions, pixels, centre_px, focal_px)
        model = cast("CameraModel", splined)  # all but the Jacobians, which nothing here needs
    else:
        model = _fitted(directions, pixels, _start(centre_px, focal_px, nearest))
    followed, valid = model.unproject(pixels)
    if not np.all(valid):
        raise InputError(
            f"{model.name} cannot follow {calibration.model.name} over all of the picture; "
            "give the calibration a smaller valid_angle_rad"
        )
    sine = np.linalg.norm(np.cross(directions, followed), axis=-1)
    off = np.arctan2(sine, np.sum(directions * followed, axis=-1))
    return Approximation(
        replace(calibration, model=model),
        rms_rad=float(np.sqrt(np.mean(off**2))),
        max_rad=float(off.max()),
    )


def _fitted(
    directions: NDArray[np.float64], pixels: NDArray[np.float64], start: CameraModel
) -> CameraModel:
    """Return the model whose pixels of directions (n, 3) are nearest to pixels (n, 2)."""

    def residual(values: NDArray[np.float64]) -> NDArray[np.float64]:
        projected, valid = with_parameters(start, values).project(directions)
        return np.where(valid[:, None], projected - pixels, _MISSED_PX).ravel()

    def jacobian(values: NDArray[np.float64]) -> NDArray[np.float64]:
        _, by_parameters = with_parameters(start, values).project_jacobian(directions)
        return np.nan_to_num(by_parameters).reshape(-1, len(values))

    fit = least_squares(residual, parameters(start), jacobian, x_scale="jac", max_nfev=100)
    return with_parameters(start, fit.x)


def _seen_pixels(calibration: Calibration) -> NDArray[np.float64]:
    width, height = calibration.image_size_px
    x, y = np.meshgrid(
        np.linspace(-0.5, width - 0.5, _GRID), np.linspace(-0.5, height - 0.5, _GRID)
    )
    pixels = np.stack([x, y], axis=-1).reshape(-1, 2)
    _, seen = calibration.unproject(pixels)
    return np.asarray(pixels[seen])


def _paraxial(calibration: Calibration) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the pixel on the lens's axis, and its pixels per radian there, in x and y."""
    if calibration.model.axis_z < 0:
        raise InputError("a mirror ball's picture is mirrored: no lens is near it")
    on_axis = np.array([[0.0, 0.0, 1.0]])
    centre = calibration.model.project(on_axis)[0][0]
    step = 0.01
    beside = np.array([[np.sin(step), 0.0, np.cos(step)], [0.0, np.sin(step), np.cos(step)]])
    moved = calibration.model.project(beside)[0] - centre
    fx, fy = np.linalg.norm(moved, axis=1) / step
    return (float(centre[0]), float(centre[1])), (float(fx), float(fy))


def _start(
    centre_px: tuple[float, float],
    focal_px: tuple[float, float],
    nearest: type[KannalaBrandt] | type[OCam],
) -> CameraModel:
    """Return an equidistant lens of the model."""
    fx, fy = focal_px
    if nearest is OCam:
        # The ray of an equidistant lens has z = ρ / tan ρ = 1 − ρ²/3 − ρ⁴/45 …
        terms = (-1 / 3, 0.0, -1 / 45, *[0.0] * (_OCAM_TERMS - 3))
        return OCam(centre_px, fx, terms, c=fy / fx)
    return KannalaBrandt(centre_px, focal_px)
