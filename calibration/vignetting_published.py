"""Published vignetting, a polynomial in the distance from the centre, as one in the angle.

Input  : k1, k2, k3 of C_d = C_s (1 + k1 R² + k2 R⁴ + k3 R⁶), as lensfun's database ("pa") and
         Hugin's photometric parameters have them, R = 1 at a corner of the picture.
         https://lensfun.github.io/calibration-tutorial/lens-vignetting.html
Output : coefficients for Calibration.vignetting, and by how much they are off.
Fails  : Hugin may move the centre of vignetting from the lens's; here it is the lens's. And a
         polynomial that was found on another sensor has its R = 1 at that one's corner.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from capture.errors import InputError

_MOST_TERMS = 5
_CLOSE = 1e-3
_ANGLES = 181
_AZIMUTHS_RAD = np.linspace(0, 2 * np.pi, 16, endpoint=False)


def from_published(
    calibration: Calibration, coefficients: Sequence[float], corner_px: float | None = None
) -> tuple[tuple[float, ...], float]:
    """Return v1, v2, … of V(θ), and the largest relative error of V in the picture.

    As few as come within a thousandth, five at most.

    Parameters
    ----------
    calibration : Calibration
        Its lens takes angles to pixels.
    coefficients : (k,) sequence of float
        k1, k2, …
    corner_px : float or None
        Distance from the centre at which R is 1; half the picture's diagonal if None.

    Raises
    ------
    InputError
        If they make a part of the picture black.
    """
    unit_px = np.hypot(*calibration.image_size_px) / 2 if corner_px is None else corner_px
    if not (np.isfinite(unit_px) and unit_px > 0):
        raise InputError(f"R = 1 lies at a positive distance from the centre, got {unit_px:g} px")
    angle, radius = _seen_radii(calibration)
    wanted = np.polynomial.polynomial.polyval((radius / unit_px) ** 2, [1.0, *coefficients])
    if not np.all(wanted > 0):
        raise InputError(
            f"the polynomial {list(coefficients)} is not positive in all of the picture, with "
            f"R = 1 at {unit_px:.1f} px from the centre; is that the corner it was made for?"
        )
    for count in range(1, _MOST_TERMS + 1):
        powers = (angle**2)[:, None] ** np.arange(1, count + 1)
        found = np.linalg.lstsq(powers / wanted[:, None], (wanted - 1) / wanted, rcond=None)[0]
        worst = float(np.abs((1 + powers @ found) / wanted - 1).max())
        if worst <= _CLOSE:
            break
    return tuple(found.tolist()), worst


def _seen_radii(calibration: Calibration) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return angles from the axis that the picture has, and distances from the centre in pixels."""
    limit = min(calibration.valid_angle_rad, calibration.model.limit_angle_rad)
    angle, azimuth = np.meshgrid(np.linspace(0.0, limit, _ANGLES), _AZIMUTHS_RAD)
    in_camera = np.stack(
        [
            np.sin(angle) * np.cos(azimuth),
            np.sin(angle) * np.sin(azimuth),
            np.cos(angle) * calibration.model.axis_z,
        ],
        axis=-1,
    )
    pixels, seen = calibration.project(in_camera @ calibration.R_world_camera.T)
    centre, _ = calibration.model.project(np.array([0.0, 0.0, calibration.model.axis_z]))
    return angle[seen], np.linalg.norm(pixels - centre, axis=-1)[seen]
