"""The lenses that are tried, from the simplest on, each started from one that already fits.

Fails  : for lenses without an axis of symmetry, but for the tilt that `unified` allows.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibration.camera import CameraModel
from calibration.models.double_sphere import DoubleSphere
from calibration.models.equidistant import Equidistant
from calibration.models.equisolid import Equisolid
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.ocam import OCam
from calibration.models.parameters import parameters, with_parameters
from calibration.models.splined_radial import SplinedRadial
from calibration.models.stereographic import Stereographic
from calibration.models.unified import Unified
from capture.errors import InputError

Array = NDArray[np.float64]

_HELD = ("c", "d", "e", "end_angle_rad")
"""Fields that are not sought: what the focal lengths say already, and where a spline ends."""

_UNSEEN_PX = 1e3


@dataclass(frozen=True, eq=False)
class Candidate:
    """A lens to be tried.

    Attributes
    ----------
    label : str
    model : CameraModel
        To start from.
    free : (P,) bool
        Which of its parameters are sought.
    """

    label: str
    model: CameraModel
    free: NDArray[np.bool_]


def candidates(reference: CameraModel, rim_angle_rad: float, square: bool) -> list[Candidate]:
    """Return the lenses to try, fewest parameters first, fitted to the reference up to the rim.

    Those that cannot reach the rim's angle are left out. With `square`, fx = fy.
    """
    directions = _cap(rim_angle_rad)
    pixels, _ = reference.project(directions)
    focal_px = np.asarray(parameters(reference)[2:4])
    centre = (float(pixels[0, 0]), float(pixels[0, 1]))
    focal = float(focal_px.mean()) if square else (float(focal_px[0]), float(focal_px[1]))
    twice = (
        float(2 * focal_px.mean()) if square else (2 * float(focal_px[0]), 2 * float(focal_px[1]))
    )
    end_rad = min(1.02 * rim_angle_rad, np.pi)
    templates: list[tuple[str, CameraModel]] = [
        ("equidistant", Equidistant(centre, focal)),
        ("equisolid", Equisolid(centre, focal)),
        ("stereographic", Stereographic(centre, focal)),
        ("double_sphere", DoubleSphere(centre, focal, 0.0, 0.6)),
        ("extended_unified", ExtendedUnified(centre, focal, 0.6, 1.0)),
        ("kannala_brandt", KannalaBrandt(centre, focal)),
        ("ocam", OCam(centre, focal, (-1 / 3, 0.0, -1 / 45, 0.0))),
        ("unified", Unified(centre, twice, 1.0)),
        ("splined_radial 8", SplinedRadial(centre, focal, end_rad, (0.0,) * 8)),
        ("splined_radial 12", SplinedRadial(centre, focal, end_rad, (0.0,) * 12)),
    ]
    started = []
    for label, template in templates:
        free = _sought(template)
        model = _fitted(template, free, directions, pixels)
        if model is not None and model.limit_angle_rad >= rim_angle_rad:
            started.append(Candidate(label, model, free))
    return started


def _sought(model: CameraModel) -> NDArray[np.bool_]:
    sizes = [(each.name, np.size(getattr(model, each.name))) for each in fields(model)]
    return np.concatenate([np.full(size, name not in _HELD) for name, size in sizes])


def _cap(rim_angle_rad: float) -> Array:
    """Return directions (n, 3) on rings up to an angle from the axis, the axis first."""
    angle, azimuth = np.meshgrid(
        np.linspace(rim_angle_rad / 24, rim_angle_rad, 24), np.arange(8) * np.pi / 4
    )
    ring = np.stack([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth)], axis=-1)
    directions = np.concatenate([ring, np.cos(angle)[..., None]], axis=-1).reshape(-1, 3)
    return np.concatenate([[[0.0, 0.0, 1.0]], directions])


def _fitted(
    template: CameraModel, free: NDArray[np.bool_], directions: Array, pixels: Array
) -> CameraModel | None:
    """Return the template with its free parameters fitted; None if none of its kind comes near."""
    values = parameters(template)

    def model_of(sought: Array) -> CameraModel:
        all_values = values.copy()
        all_values[free] = sought
        return with_parameters(template, all_values)

    def residuals(sought: Array) -> Array:
        try:
            projected, _ = model_of(sought).project(directions)
        except InputError:
            return np.full(pixels.size, _UNSEEN_PX)
        return np.nan_to_num(projected - pixels, nan=_UNSEEN_PX).ravel()

    found = least_squares(residuals, values[free], method="lm", x_scale="jac", max_nfev=400)
    near = np.sqrt(np.mean(found.fun**2)) < _UNSEEN_PX / 10
    return model_of(found.x) if near else None
