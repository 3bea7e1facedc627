"""From radiance to what a display shows: exposure, a shoulder for highlights, the sRGB curve.

Only pictures for people go through this; files of radiance do not.
"""

import numpy as np
from numpy.typing import NDArray

from capture.sensor import srgb_encode
from lighting.environment import luminance

MIDDLE_GREY = 0.18
SHOULDER = 0.8
"""Linear value up to which the view is exact."""


def to_display(radiance: NDArray[np.floating], exposure_ev: float) -> NDArray[np.uint8]:
    """Return the picture of linear radiance as sRGB-coded 8-bit values.

    Parameters
    ----------
    radiance : (H, W, 3 or 4) float
        Linear Rec.709, at least 0; alpha, if there is one, is ignored.
    exposure_ev : float
        The radiance is multiplied by 2^exposure_ev.

    Returns
    -------
    (H, W, 3) uint8
        Exact up to 0.8 linear; above, `roll_off` in each channel by itself, so that highlights
        turn white.
    """
    exposed = radiance[..., :3].astype(np.float32) * np.float32(2.0**exposure_ev)
    return np.rint(255 * srgb_encode(roll_off(exposed))).astype(np.uint8)


def roll_off(linear: NDArray[np.floating]) -> NDArray[np.floating]:
    """Values as they are up to 0.8, then along a hyperbola of the same slope that approaches 1."""
    excess = np.maximum(linear - SHOULDER, 0) / (1 - SHOULDER)
    # 1 − 1/(1 + x) is x/(1 + x) without its ∞/∞.
    return np.minimum(linear, SHOULDER) + (1 - SHOULDER) * (1 - 1 / (1 + excess))


def auto_exposure_ev(radiance: NDArray[np.floating]) -> float:
    """Return the exposure that puts the log-mean luminance of the scene at middle grey, 0.18.

    Parameters
    ----------
    radiance : (H, W, 4) float
        A rendered picture; only pixels that the scene covers wholly count, and of these the lit
        ones. 0 without any.
    """
    lit = luminance(radiance[..., :3][radiance[..., 3] == 1])
    lit = lit[lit > 0]
    if len(lit) == 0:
        return 0.0
    return float(np.log2(MIDDLE_GREY) - np.log2(lit).mean())
