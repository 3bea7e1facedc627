"""Two directions across a normal, for compiled loops.

References
----------
.. [1] T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
"""

import math

from numba import njit


@njit(nogil=True)
def tangent_frame(
    nx: float, ny: float, nz: float
) -> tuple[float, float, float, float, float, float]:  # pragma: no cover - compiled
    """Return tangent and bitangent (x, y, z, x, y, z) of a unit normal."""
    sign = math.copysign(1.0, nz)
    a = -1 / (sign + nz)
    b = nx * ny * a
    return 1 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny
