"""How much of the sphere each pixel of a camera covers, and where: ∫dω and ∫d dω.

Input  : directions of the pixels' corners.    Output : solid angles and first moments.
A pixel is the spherical polygon of its corners, for which both integrals have closed forms. Pixels
tile what the camera sees, so that sums over them are exact too.
Fails  : sides of pixels are taken for great circles, which a lens bends a little; what one pixel
loses its neighbour gains. Corners no longer tell the shape of pixels of more than about 90°.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.footprint import triangle_solid_angle


def pixel_moments(
    corners: NDArray[np.float64], seen: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ∫dω (P,) in sr and ∫d dω (P, 3) of the P seen pixels, row by row.

    Parameters
    ----------
    corners : (h + 1, W + 1, 3) float64
        World directions of the pixels' corners.
    seen : (h, W) bool
    """
    rows, columns = np.nonzero(seen)
    return _pixel_moments(corners, rows, columns)


@njit(cache=True, nogil=True)
def polygon_moment(a, b, c, d):  # type: ignore[no-untyped-def]
    """Return ∫d dω (x, y, z) over the spherical quadrilateral of unit vectors a, b, c, d.

    By Stokes' theorem it is ½ ∮ d × dd: over an arc of a great circle, half the arc's angle times
    its normal. The sign is taken so that it points to the middle of a and c.
    """
    x = y = z = 0.0
    for p, q in ((a, b), (b, c), (c, d), (d, a)):
        # p × q as p × (q − p), which loses no digits where they are close.
        dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        nx, ny, nz = p[1] * dz - p[2] * dy, p[2] * dx - p[0] * dz, p[0] * dy - p[1] * dx
        sine = math.sqrt(nx * nx + ny * ny + nz * nz)
        if sine > 0.0:
            angle = math.atan2(sine, p[0] * q[0] + p[1] * q[1] + p[2] * q[2])
            factor = angle / sine / 2
            x += factor * nx
            y += factor * ny
            z += factor * nz
    if x * (a[0] + c[0]) + y * (a[1] + c[1]) + z * (a[2] + c[2]) < 0.0:
        return -x, -y, -z
    return x, y, z


@njit(cache=True, nogil=True)
def _pixel_moments(corners, rows, columns):  # type: ignore[no-untyped-def]
    solid_angles = np.empty(len(rows))
    moments = np.empty((len(rows), 3))
    for i in range(len(rows)):
        r, c = rows[i], columns[i]
        p00, p01 = corners[r, c], corners[r, c + 1]
        p10, p11 = corners[r + 1, c], corners[r + 1, c + 1]
        solid_angles[i] = triangle_solid_angle(p00, p01, p11) + triangle_solid_angle(p00, p11, p10)
        moments[i] = polygon_moment(p00, p01, p11, p10)
    return solid_angles, moments
