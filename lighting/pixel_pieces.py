"""Which blocks of the sphere a camera's pixels lie in, and how much of it each pixel covers.

Input  : directions of the pixels' corners.    Output : pieces: block, pixel, ∫dω and ∫d dω.
A pixel is the spherical polygon of its corners, for which both integrals have closed forms; pixels
tile what the camera sees, so sums over them are exact too. A pixel of up to half a block is one
piece, in the block that its middle lies in. A larger one is divided into pieces of at most that.
Domain : the compiled kernels work on plain arrays; lighting/source_blocks.py is their door.
Fails  : sides of pixels are taken for great circles, which a lens bends a little; what one pixel
loses its neighbour gains. Corners no longer tell the shape of pixels of more than about 90°.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.footprint import triangle_solid_angle

_LARGEST = 0.5
"""Longest side of a piece, in rows of blocks."""


def pixel_pieces(
    corners: NDArray[np.float64], seen: NDArray[np.bool_], rows: int
) -> tuple[NDArray[np.int32], NDArray[np.uint32], NDArray[np.float32]]:
    """Return the pieces of seen pixels, those of one pixel in one block taken together.

    Parameters
    ----------
    corners : (h + 1, W + 1, 3) float64
        World directions of the pixels' corners.
    seen : (h, W) bool
    rows : int
        Rows of the grid of blocks; it has twice as many columns.

    Returns
    -------
    blocks : (P,) int32
        Flat index of the block of each piece.
    pixels : (P,) uint32
        Flat index of its pixel, never falling.
    weights : (P, 4) float32
        ∫dω in sr, and ∫(d − d_b) dω (3) about the direction d_b of the block's centre: small
        numbers, so that single precision is enough.
    """
    most = _most_pieces(corners, seen, rows)
    blocks, pixels, weights, count = _pieces(corners, seen, *axis_factors(rows), most)
    return blocks[:count], pixels[:count], weights[:count]


def axis_factors(rows: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (sin θ, cos θ) of rows of blocks and (sin φ, cos φ) of columns, for `block_centre`."""
    theta = np.pi * (np.arange(rows) + 0.5) / rows
    phi = np.pi - np.pi * (np.arange(2 * rows) + 0.5) / rows
    return (
        np.stack([np.sin(theta), np.cos(theta)], axis=-1),
        np.stack([np.sin(phi), np.cos(phi)], axis=-1),
    )


@njit(cache=True, nogil=True)
def block_centre(block, row_factors, column_factors):  # type: ignore[no-untyped-def]
    """Return the direction (x, y, z) of the centre of a block, given by its flat index."""
    row, column = divmod(block, len(column_factors))
    sin_theta, cos_theta = row_factors[row]
    sin_phi, cos_phi = column_factors[column]
    return sin_theta * sin_phi, cos_theta, sin_theta * cos_phi


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
def _splits(corners, r, c, rows):  # type: ignore[no-untyped-def]
    """Return into how many pieces a pixel is divided, along its row and along its column."""
    along_row = max(
        _squared_distance(corners[r, c], corners[r, c + 1]),
        _squared_distance(corners[r + 1, c], corners[r + 1, c + 1]),
    )
    along_column = max(
        _squared_distance(corners[r, c], corners[r + 1, c]),
        _squared_distance(corners[r, c + 1], corners[r + 1, c + 1]),
    )
    per_rad = rows / math.pi / _LARGEST
    return (
        max(math.ceil(math.sqrt(along_row) * per_rad), 1),
        max(math.ceil(math.sqrt(along_column) * per_rad), 1),
    )


@njit(cache=True, nogil=True)
def _squared_distance(a, b):  # type: ignore[no-untyped-def]
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@njit(cache=True, nogil=True)
def _most_pieces(corners, seen, rows):  # type: ignore[no-untyped-def]
    """Return how many pieces there are, if no two of a pixel share a block."""
    total = 0
    for r in range(seen.shape[0]):
        for c in range(seen.shape[1]):
            if seen[r, c]:
                across, down = _splits(corners, r, c, rows)
                total += across * down
    return total


@njit(cache=True, nogil=True)
def _between(corners, r, c, u, v, direction):  # type: ignore[no-untyped-def]
    """Set `direction` to the unit vector at (u, v), 0 to 1 each, between a pixel's corners."""
    for k in range(3):
        direction[k] = (1 - v) * ((1 - u) * corners[r, c, k] + u * corners[r, c + 1, k]) + v * (
            (1 - u) * corners[r + 1, c, k] + u * corners[r + 1, c + 1, k]
        )
    direction /= math.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)


@njit(cache=True, nogil=True)
def _block_of(x, y, z, rows):  # type: ignore[no-untyped-def]
    per_rad = rows / math.pi
    row = min(int(math.atan2(math.hypot(x, z), y) * per_rad), rows - 1)
    column = int((math.pi - math.atan2(x, z)) * per_rad) % (2 * rows)
    return row * 2 * rows + column


@njit(cache=True, nogil=True)
def _pieces(corners, seen, row_factors, column_factors, most):  # type: ignore[no-untyped-def]
    """Return blocks, pixels and weights as `pixel_pieces`, with room for `most`, and how many."""
    rows = len(row_factors)
    blocks = np.empty(most, np.int32)
    pixels = np.empty(most, np.uint32)
    weights = np.zeros((most, 4), np.float32)
    count = 0
    a, b, c, d = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for row in range(seen.shape[0]):
        for column in range(seen.shape[1]):
            if not seen[row, column]:
                continue
            across, down = _splits(corners, row, column, rows)
            first = count
            for j in range(down):
                for i in range(across):
                    _between(corners, row, column, i / across, j / down, a)
                    _between(corners, row, column, (i + 1) / across, j / down, b)
                    _between(corners, row, column, (i + 1) / across, (j + 1) / down, c)
                    _between(corners, row, column, i / across, (j + 1) / down, d)
                    solid_angle = triangle_solid_angle(a, b, c) + triangle_solid_angle(a, c, d)
                    x, y, z = polygon_moment(a, b, c, d)
                    block = _block_of(x, y, z, rows)
                    k = count - 1
                    while k >= first and blocks[k] != block:
                        k -= 1
                    if k < first:
                        k = count
                        count += 1
                        blocks[k] = block
                        pixels[k] = row * seen.shape[1] + column
                    centre_x, centre_y, centre_z = block_centre(block, row_factors, column_factors)
                    weights[k, 0] += solid_angle
                    weights[k, 1] += x - solid_angle * centre_x
                    weights[k, 2] += y - solid_angle * centre_y
                    weights[k, 3] += z - solid_angle * centre_z
    return blocks, pixels, weights, count
