"""Which cells of the lat-long grid the light of a camera pixel belongs to.

Input  : directions of a pixel's corners.    Output : cells and weights that sum to 1.
A pixel is a spherical quadrilateral. It is divided into sub-samples, each of which stands for the
area around it (a pixel that ends in a pole is a wedge) and is shared among the cells around it by a
tent in row and column. A tent of one cell keeps the position of what it shares out; where a
sub-sample spans more than a cell (magnification; columns near a pole) its tent spans as much, so
that no cell between two sub-samples is left out.
Domain : the compiled kernels work on plain arrays; lighting/maps/remap.py is their door.
Fails  : for pixels that span more than about 90°, whose corners no longer tell their shape; in the
outermost rows of a 360° picture magnified twofold or more, whose pixels gain or lose up to 5 %.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.sphere.latlong import solid_angles

_SINGLE_EXTENT = 0.55
"""Extent in cells up to which one sample stands for a pixel of a balanced operator. Measured: four
samples place a light three hundredths of a cell better and cost a fifth more entries."""
_FINE_EXTENT = 0.2
"""The same for single pictures, which are not balanced."""
_PARTS = 4
"""Parts the picture is cut into for threads; fixed, so that no result depends on their number."""
BAND_PARTS = 2
"""Parts each band is cut into for threads; each needs its own copy of the map."""
_POLE_EXTENTS = 3.0
"""Distance from a pole, in pixel extents, within which columns turn under a single pixel."""


def row_balance(height: int) -> NDArray[np.float64]:
    """Return factors of each row's tent with which uniform light fills every row evenly, (height,).

    A plain tent gives a row of cells the integral of the tent over the sphere. Next to a pole that
    is 8 % more than the row's solid angle, elsewhere nearly equal. With the factors ρ, and weights
    T_r ρ_r / Σ T ρ, it is equal for all rows; they are found by alternating the two conditions
    (Sinkhorn's iteration), on a fine grid of colatitudes.
    """
    samples_per_row = 32
    y = (np.arange(height * samples_per_row) + 0.5) / samples_per_row - 0.5
    mass = np.sin(np.pi * (y + 0.5) / height)
    target = solid_angles(height)
    mass *= target.sum() / mass.sum()
    above = np.floor(y).astype(int)
    below_weight = y - above
    rows = np.clip(np.stack([above, above + 1]), 0, height - 1)  # a pole reflects onto its own row
    weights = np.stack([1.0 - below_weight, below_weight])
    factors = np.ones(height)
    for _ in range(100):
        shares = weights * factors[rows]
        shares *= mass / shares.sum(axis=0)
        factors *= target / np.bincount(rows.ravel(), shares.ravel(), minlength=height)
    return factors


@njit(cache=True, nogil=True)
def triangle_solid_angle(a, b, c):  # type: ignore[no-untyped-def]
    """Return the solid angle in sr of the spherical triangle of unit vectors a, b, c.

    A. van Oosterom and J. Strackee, "The solid angle of a plane triangle", IEEE Transactions on
    Biomedical Engineering, 1983.
    """
    triple = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
    ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
    return abs(2.0 * math.atan2(triple, 1.0 + ab + bc + ca))


@njit(cache=True, nogil=True)
def pixel_footprint(  # type: ignore[no-untyped-def]
    corners, r, c, fine_extent, factors, slot, cells, weights
):
    """Find the cells that pixel (r, c) lights; return their number and the pixel's solid angle.

    Parameters
    ----------
    corners : (H + 1, W + 1, 3) float64
        World directions of the pixels' corners.
    r, c : int
        Row and column of the pixel.
    fine_extent : float
        Extent in cells up to which one sample stands for the pixel.
    factors : (N,) float64
        row_balance(N).
    slot : (2N²,) int32
        Scratch: −1 everywhere, before and after.
    cells, weights : (2N²,) int32 and float64
        Filled from the start with flat indices of cells and their weights, which sum to 1.
    """
    height = len(factors)
    per_rad = height / math.pi
    c00, c01 = corners[r, c], corners[r, c + 1]
    c10, c11 = corners[r + 1, c], corners[r + 1, c + 1]
    solid_angle = triangle_solid_angle(c00, c01, c11) + triangle_solid_angle(c00, c11, c10)

    # The pixel's sides, in cells.
    ax = 0.5 * (c01[0] - c00[0] + c11[0] - c10[0]) * per_rad
    ay = 0.5 * (c01[1] - c00[1] + c11[1] - c10[1]) * per_rad
    az = 0.5 * (c01[2] - c00[2] + c11[2] - c10[2]) * per_rad
    bx = 0.5 * (c10[0] - c00[0] + c11[0] - c01[0]) * per_rad
    by = 0.5 * (c10[1] - c00[1] + c11[1] - c01[1]) * per_rad
    bz = 0.5 * (c10[2] - c00[2] + c11[2] - c01[2]) * per_rad
    extent = math.sqrt(max(ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz))
    from_pole = math.hypot(c00[0] + c11[0], c00[2] + c11[2]) / 2  # sin θ
    splits = 1 if extent <= fine_extent else 2
    if 1.2 * from_pole < extent < 2.0 * from_pole:
        splits = 3  # two samples would leave up to a whole column between them
    if from_pole * per_rad < _POLE_EXTENTS * max(extent, 1.0):
        splits = 4

    count = 0
    total = 0.0
    for j in range(splits):
        v = (j + 0.5) / splits
        for i in range(splits):
            u = (i + 0.5) / splits
            w00, w01, w10, w11 = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
            dx = w00 * c00[0] + w01 * c01[0] + w10 * c10[0] + w11 * c11[0]
            dy = w00 * c00[1] + w01 * c01[1] + w10 * c10[1] + w11 * c11[1]
            dz = w00 * c00[2] + w01 * c01[2] + w10 * c10[2] + w11 * c11[2]
            rho = max(math.hypot(dx, dz), 1e-12)
            length = math.hypot(rho, dy)
            sin_phi, cos_phi = dx / rho, dz / rho
            sin_theta, cos_theta = rho / length, dy / length
            tx, ty, tz = cos_theta * sin_phi, -sin_theta, cos_theta * cos_phi
            extent_rows = abs(ax * tx + ay * ty + az * tz) + abs(bx * tx + by * ty + bz * tz)
            extent_columns = (
                abs(ax * cos_phi - az * sin_phi) + abs(bx * cos_phi - bz * sin_phi)
            ) / sin_theta
            area = _parallelogram_area(
                (1 - v) * (c01[0] - c00[0]) + v * (c11[0] - c10[0]),
                (1 - v) * (c01[1] - c00[1]) + v * (c11[1] - c10[1]),
                (1 - v) * (c01[2] - c00[2]) + v * (c11[2] - c10[2]),
                (1 - u) * (c10[0] - c00[0]) + u * (c11[0] - c01[0]),
                (1 - u) * (c10[1] - c00[1]) + u * (c11[1] - c01[1]),
                (1 - u) * (c10[2] - c00[2]) + u * (c11[2] - c01[2]),
            )
            total += area
            half_rows = min(max(1.0, extent_rows / splits), float(height))
            half_columns = min(max(1.0, extent_columns / splits), float(height))
            row = math.atan2(rho, dy) * per_rad - 0.5
            column = (math.pi - math.atan2(dx, dz)) * per_rad - 0.5
            count = _share_out(
                area, row, half_rows, column, half_columns, factors, slot, cells, weights, count
            )
    for k in range(count):
        slot[cells[k]] = -1
        weights[k] /= total
    return count, solid_angle


@njit(cache=True, nogil=True, inline="always")
def _parallelogram_area(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    """Return |a × b|, but not 0, so that shares of it can be taken."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return max(math.sqrt(x * x + y * y + z * z), 1e-300)


@njit(cache=True, nogil=True)
def _share_out(  # type: ignore[no-untyped-def]
    share, row, half_rows, column, half_columns, factors, slot, cells, weights, count
):
    """Add `share` to the cells around (row, column) under a tent; return the number of cells."""
    height = len(factors)
    first_row, last_row = math.ceil(row - half_rows), math.floor(row + half_rows)
    first_column, last_column = math.ceil(column - half_columns), math.floor(column + half_columns)
    row_sum = 0.0
    for r in range(first_row, last_row + 1):
        row_sum += (half_rows - abs(r - row)) * factors[_reflected(r, height)]
    column_sum = 0.0
    for c in range(first_column, last_column + 1):
        column_sum += half_columns - abs(c - column)
    share /= row_sum * column_sum
    for r in range(first_row, last_row + 1):
        grid_row = _reflected(r, height)
        row_weight = share * (half_rows - abs(r - row)) * factors[grid_row]
        turn = 0 if r == grid_row else height  # beyond a pole lies the opposite meridian
        for c in range(first_column, last_column + 1):
            weight = row_weight * (half_columns - abs(c - column))
            if weight > 0.0:
                cell = grid_row * 2 * height + (c + turn) % (2 * height)
                if slot[cell] < 0:
                    slot[cell] = count
                    cells[count] = cell
                    weights[count] = weight
                    count += 1
                else:
                    weights[slot[cell]] += weight
    return count


@njit(cache=True, nogil=True, inline="always")
def _reflected(row, height):  # type: ignore[no-untyped-def]
    if row < 0:
        return -1 - row
    if row >= height:
        return 2 * height - 1 - row
    return row


@njit(cache=True, nogil=True, parallel=True)
def count_entries(corners, seen, factors):  # type: ignore[no-untyped-def]
    """Count the entries that each part of the picture has in each cell, (_PARTS, 2N²)."""
    rows = seen.shape[0]
    cell_count = 2 * len(factors) ** 2
    counts = np.zeros((_PARTS, cell_count), np.int64)
    for part in prange(_PARTS):
        slot = np.full(cell_count, -1, np.int32)
        cells = np.empty(cell_count, np.int32)
        shares = np.empty(cell_count, np.float64)
        for r in range(part * rows // _PARTS, (part + 1) * rows // _PARTS):
            for c in range(seen.shape[1]):
                if seen[r, c]:
                    count, _ = pixel_footprint(
                        corners, r, c, _SINGLE_EXTENT, factors, slot, cells, shares
                    )
                    for k in range(count):
                        counts[part, cells[k]] += 1
    return counts


@njit(cache=True, nogil=True, parallel=True)
def fill_entries(corners, seen, factors, places, entry_count):  # type: ignore[no-untyped-def]
    """Find the pixel and mass in sr of every entry, and the solid angle of every pixel.

    `places` (_PARTS, 2N²) says where each part's next entry of each cell goes; it is used up.
    """
    rows, columns = seen.shape
    cell_count = places.shape[1]
    pixels = np.empty(entry_count, np.uint32)
    masses = np.empty(entry_count, np.float32)
    pixel_sr = np.zeros(rows * columns, np.float64)
    for part in prange(_PARTS):
        slot = np.full(cell_count, -1, np.int32)
        cells = np.empty(cell_count, np.int32)
        shares = np.empty(cell_count, np.float64)
        for r in range(part * rows // _PARTS, (part + 1) * rows // _PARTS):
            for c in range(columns):
                if seen[r, c]:
                    count, solid_angle = pixel_footprint(
                        corners, r, c, _SINGLE_EXTENT, factors, slot, cells, shares
                    )
                    pixel_sr[r * columns + c] = solid_angle
                    for k in range(count):
                        place = places[part, cells[k]]
                        places[part, cells[k]] += 1
                        pixels[place] = r * columns + c
                        masses[place] = shares[k] * solid_angle
    return pixels, masses, pixel_sr


@njit(cache=True, nogil=True, parallel=True)
def add_band(  # type: ignore[no-untyped-def]
    corners, seen, factors, radiance, illumination, pixel_clipped, flux, seen_sr, clipped
):
    """Add the light of a band of pixels to `flux` and `seen_sr`, which have a copy per part."""
    rows, columns = seen.shape
    cell_count = 2 * len(factors) ** 2
    for part in prange(BAND_PARTS):
        slot = np.full(cell_count, -1, np.int32)
        cells = np.empty(cell_count, np.int32)
        shares = np.empty(cell_count, np.float64)
        for r in range(part * rows // BAND_PARTS, (part + 1) * rows // BAND_PARTS):
            for c in range(columns):
                if seen[r, c]:
                    count, solid_angle = pixel_footprint(
                        corners, r, c, _FINE_EXTENT, factors, slot, cells, shares
                    )
                    gain = 1.0 / illumination[r, c] if illumination.size else 1.0
                    for k in range(count):
                        cell = cells[k]
                        mass = shares[k] * solid_angle
                        seen_sr[part, cell] += mass
                        for channel in range(3):
                            flux[part, cell, channel] += mass * gain * radiance[r, c, channel]
                        if pixel_clipped[r, c]:
                            clipped[cell] = True
