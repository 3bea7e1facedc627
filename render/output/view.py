"""From radiance to what a display shows: exposure, a shoulder for highlights, the sRGB curve.

Only pictures for people go through this; files of radiance do not.
"""

from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from capture.sensor import srgb_encode
from lighting.maps.environment import luminance

MIDDLE_GREY = 0.18
SHOULDER = 0.8
"""Linear value up to which the view is exact."""

_INDEX_SHIFT = 15
"""Of a float32's bits: exponent and eight bits of the fraction are left, few enough for the caches,
and enough for no two codes to begin between two neighbours."""


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
    values = np.ascontiguousarray(radiance, np.float32)
    shown = np.empty((*values.shape[:2], 3), np.uint8)
    _encode(values, np.float32(2.0**exposure_ev), *_code_tables(), shown)
    return shown


def _code(linear: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return what `to_display` shows for exposed values, without its tables."""
    return np.rint(255 * srgb_encode(roll_off(linear)))


@cache
def _code_tables() -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return the code at the lower end of each run of float32 numbers, and where codes begin.

    The codes are not decreasing, so that the bits of the first number with code 1, 2, … 255 are
    found by halving. The last beginning is NaN: no number passes it.
    """
    codes = np.arange(1, 256)
    below, first = np.zeros(255, np.uint32), np.full(255, np.float32(np.inf).view(np.uint32))
    while np.any(first - below > 1):
        middle = below + (first - below) // 2
        reached = _code(middle.view(np.float32).astype(np.float64)) >= codes
        first, below = np.where(reached, middle, first), np.where(reached, below, middle)
    begins = np.concatenate([[0.0], first.view(np.float32), [np.nan]]).astype(np.float32)
    lower_ends = (np.arange(1 << (31 - _INDEX_SHIFT), dtype=np.uint32) << _INDEX_SHIFT).view(
        np.float32
    )
    return (np.searchsorted(begins[1:-1], lower_ends, "right")).astype(np.uint8), begins


@njit(cache=True, nogil=True)
def _encode(
    radiance: NDArray[np.float32],
    scale: np.float32,
    codes: NDArray[np.uint8],
    begins: NDArray[np.float32],
    shown: NDArray[np.uint8],
) -> None:  # pragma: no cover - compiled
    height, width = shown.shape[:2]
    exposed = np.empty(3 * width, np.float32)
    bits = exposed.view(np.uint32)
    for row in range(height):
        for column in range(width):
            for channel in range(3):
                value = scale * radiance[row, column, channel]
                exposed[3 * column + channel] = value if value > 0 else np.float32(0)  # NaN too
        for column in range(width):
            for channel in range(3):
                at = np.uintp(3 * column + channel)
                code = np.uintp(codes[bits[at] >> np.uint32(_INDEX_SHIFT)])
                is_next = exposed[at] >= begins[code + np.uintp(1)]
                shown[row, column, channel] = code + np.uintp(is_next)


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
    return exposure_of(luminance(radiance[..., :3][radiance[..., 3] == 1]))


def exposure_of(luminances: NDArray[np.floating]) -> float:
    """Return the exposure that puts the log-mean of the lit ones (n,) at middle grey, 0 of none."""
    lit = luminances[luminances > 0]
    return float(np.log2(MIDDLE_GREY) - np.log2(lit).mean()) if len(lit) else 0.0
