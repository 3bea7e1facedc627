"""Where sixteen directions meet a map, and how much of it each looks up: for compiled loops.

As `background.map_coordinates` and `map_pyramid.around`, by polynomials that are vectorised.

Domain : directions of any length above 0; parts of 1e-12 to 4π sr.
Fails  : u and v are off by up to 1e-6, the octave by up to 1e-3.
"""

import math

import numpy as np
from numba import njit
from numpy.polynomial import Polynomial
from numpy.polynomial.chebyshev import Chebyshev
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE

_FLOATS = NDArray[np.float32]

_HALF_BY_PI = np.float32(0.5 / math.pi)
_TINY = np.float32(1e-30)


def _arc_per_tangent(squared: NDArray[np.float64]) -> NDArray[np.float64]:
    tangent = np.sqrt(np.maximum(squared, 1e-20))
    arc: NDArray[np.float64] = np.arctan(tangent) / tangent
    return arc


# By powers of the tangent squared, 0 to 1, and of the mantissa less 1, 0 to 1.
_ARC = (
    Chebyshev.interpolate(_arc_per_tangent, 8, domain=[0, 1])
    .convert(kind=Polynomial)
    .coef.astype(np.float32)
)
_LOG2 = (
    Chebyshev.interpolate(lambda x: np.log2(1 + x), 4, domain=[0, 1])
    .convert(kind=Polynomial)
    .coef.astype(np.float32)
)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def place_on_map(
    directions: _FLOATS, share_sr: _FLOATS, places: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set `places` (4, n) to what `mean_over` takes of directions (≥ 3, n) and parts (n,)."""
    zero, one, half = np.float32(0), np.float32(1), np.float32(0.5)
    count = np.uint64(places.shape[1])
    for i in range(count):
        x, y, z = directions[0, i], directions[1, i], directions[2, i]
        level = np.float32(math.sqrt(x * x + z * z))
        places[0, i] = half - _HALF_BY_PI * angle_of(x, z)
        places[1, i] = np.float32(2) * _HALF_BY_PI * angle_of(level, y)
        sine = level / np.float32(math.sqrt(x * x + y * y + z * z))
        width = np.float32(math.sqrt(share_sr[i]))
        places[2, i] = min(width * _HALF_BY_PI / max(sine, np.float32(1e-6)), one)
        # The square of the width in half turns, whose exponent is log₂ in whole numbers.
        places[3, i] = max(share_sr[i] * np.float32(1 / math.pi**2), np.float32(1e-18))
    bits = places[3].view(np.int32)
    for i in range(count):
        exponent = np.float32((bits[i] >> 23) - 127)
        bits[i] = (bits[i] & 0x7FFFFF) | 0x3F800000
        mantissa, log2 = places[3, i] - one, zero
        for k in range(len(_LOG2)):
            log2 = log2 * mantissa + _LOG2[len(_LOG2) - 1 - k]
        places[3, i] = half * (exponent + log2)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy", inline="always")
def angle_of(a: np.float32, b: np.float32) -> np.float32:  # pragma: no cover - compiled
    """Return atan2(a, b), off by less than 1e-6."""
    one = np.float32(1)
    along, across = abs(a), abs(b)
    tangent = min(along, across) / max(max(along, across), _TINY)
    squared, arc = tangent * tangent, np.float32(0)
    for k in range(len(_ARC)):
        arc = arc * squared + _ARC[len(_ARC) - 1 - k]
    arc = arc * tangent
    arc = np.float32(math.pi / 2) - arc if along > across else arc
    arc = np.float32(math.pi) - arc if b < 0 else arc
    return arc * (one if a >= 0 else -one)
