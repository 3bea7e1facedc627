"""Irradiance from uniform discs of light that edges cut: exact, by integrals over their outlines.

A disc of light at infinity is a spherical cap. So is all else here: the hemisphere above a surface
and the free side of a wall's edge are caps of radius π/2, what a sphere leaves free is the cap
around the opposite of its direction. What reaches the surface comes from where caps overlap, whose
outline consists of arcs of their circles, and ∫ n·d dω over it is ½ Σ ∫ n·(d × d′) dt along the
arcs (Lambert's formula, for arcs of any circle; it follows from Stokes' theorem).

Domain : unit vectors in one frame, angles in rad.
Cost   : a few dot products for a disc wholly inside or outside of each cap, about 1 µs for one cut.
Fails  : two caps with the same circle count the arcs they share twice; discs below 1e-4 rad
         would lose digits, so they are points, wholly seen or not at all.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

SUN_RADIUS_RAD = np.radians(0.2665)
"""Mean angular radius of the sun's disc as seen from the Earth."""

_SMALLEST_RADIUS_RAD = 1e-4
_ROUNDING = 1e-12


def received(
    normals: Array,
    openings: Array,
    opening_radius_rad: float,
    directions: Array,
    irradiance: Array,
    angular_radius_rad: Array,
) -> Array:
    """Return the irradiance (n, C) on surfaces from uniform discs that they see through openings.

    Parameters
    ----------
    normals : (n, 3) float64
        Unit vectors.
    openings : (n, m, k, 3) float64
        What each surface sees through: m regions that do not overlap, each where k caps around
        these unit vectors overlap. A region of no caps (k = 0) is open on all sides.
    opening_radius_rad : float
        Radius of these caps.
    directions : (K, 3) float64
        Unit vectors toward the discs' centres.
    irradiance : (K, C) float64
        ∫L dω of each disc. A disc of radius a gives a surface that faces it this × (1 + cos a)/2.
        May be negative.
    angular_radius_rad : (K,) float64
        0 to π. A disc of radius 0 is a point.
    """
    radius = np.where(angular_radius_rad < _SMALLEST_RADIUS_RAD, 0.0, angular_radius_rad)
    # Copies, because numba would compile anew for arrays that are read-only or not contiguous.
    return _received(
        np.array(normals, order="C"),
        np.array(openings, order="C"),
        np.array([np.cos(opening_radius_rad), np.sin(opening_radius_rad)]),
        np.column_stack([directions, np.cos(radius), np.sin(radius)]),
        np.array(irradiance, np.float64, order="C"),
    )


@njit(cache=True, nogil=True)
def _received(normals, openings, opening_radius, discs, irradiance):  # type: ignore[no-untyped-def]
    """Sum over discs; a cap is (x, y, z, cos R, sin R)."""
    channels = irradiance.shape[1]
    total = np.zeros((len(normals), channels))
    for i in range(len(normals)):
        caps = np.empty((2 + openings.shape[2], 5))
        horizon = (normals[i, 0], normals[i, 1], normals[i, 2], 0.0, 1.0)
        for j in range(len(discs)):
            disc = _cap(discs, j)
            above = _overlap(disc, horizon)
            if above < 0:
                continue
            _set(caps, 0, disc)
            _set(caps, 1, horizon)
            weight = 0.0
            for m in range(openings.shape[1]):
                count = 2 if above == 0 else 1
                is_whole = above > 0
                overlap = 1
                for k in range(openings.shape[2]):
                    x, y, z = openings[i, m, k, 0], openings[i, m, k, 1], openings[i, m, k, 2]
                    opening = (x, y, z, opening_radius[0], opening_radius[1])
                    overlap = _overlap(disc, opening)
                    if overlap < 0:
                        break
                    if overlap == 0:
                        is_whole = False
                        _set(caps, count, opening)
                        count += 1
                if overlap < 0:
                    continue
                if is_whole:
                    cosine = _dot(disc, horizon)
                    weight = cosine * (1 + disc[3]) / 2
                    break
                solid_angle = 2 * np.pi * (1 - disc[3])
                weight += projected_solid_angle(caps[:count], normals[i]) / solid_angle
            for channel in range(channels):
                total[i, channel] += weight * irradiance[j, channel]
    return total


@njit(cache=True, nogil=True)
def projected_solid_angle(caps, normal):  # type: ignore[no-untyped-def]
    """Return ∫ n·d dω over where all `caps` overlap.

    Parameters
    ----------
    caps : (k, 5) float64
        (x, y, z, cos R, sin R): unit axis, radius R below π. No two have the same circle.
    normal : (3,) float64
        Unit vector. Where d is below the horizon the integrand is negative: let one of the caps be
        the hemisphere above the surface.
    """
    total = 0.0
    ends = np.empty(2 * len(caps))
    for i in range(len(caps)):
        cap = _cap(caps, i)
        u, v = _orthonormal(cap)
        count = 0
        is_outside = False
        for j in range(len(caps)):
            if j == i:
                continue
            # The circle is d(t) = cos R c + sin R (u cos t + v sin t); it is inside the other cap
            # where mean + reach cos(t − t₀) > 0.
            other = _cap(caps, j)
            mean = cap[3] * _dot(cap, other) - other[3]
            along_u = cap[4] * _dot(u, other)
            along_v = cap[4] * _dot(v, other)
            reach = np.sqrt(along_u * along_u + along_v * along_v)
            if reach > abs(mean):
                middle = np.arctan2(along_v, along_u)
                half = np.arccos(-mean / reach)
                ends[count] = (middle - half) % (2 * np.pi)
                ends[count + 1] = (middle + half) % (2 * np.pi)
                count += 2
            elif mean < 0:
                is_outside = True
                break
        if is_outside:
            continue
        if count == 0:
            total += np.pi * cap[4] ** 2 * _dot(cap, normal)
            continue
        ends[:count].sort()
        for end in range(count):
            start = ends[end]
            stop = ends[end + 1] if end + 1 < count else ends[0] + 2 * np.pi
            if _is_inside_others(caps, i, u, v, (start + stop) / 2):
                total += _arc_integral(cap, u, v, start, stop, normal)
    return total


@njit(cache=True, nogil=True)
def _arc_integral(cap, u, v, start, stop, normal):  # type: ignore[no-untyped-def]
    """Return ½ ∫ n·(d × d′) dt over t in [start, stop]."""
    along_axis = cap[4] * (stop - start) * _dot(cap, normal)
    along_u = cap[3] * (np.sin(stop) - np.sin(start)) * _dot(u, normal)
    along_v = cap[3] * (np.cos(start) - np.cos(stop)) * _dot(v, normal)
    return cap[4] / 2 * (along_axis - along_u - along_v)


@njit(cache=True, nogil=True)
def _is_inside_others(caps, own, u, v, t):  # type: ignore[no-untyped-def]
    """Tell whether the point at t of one cap's circle is inside all other caps."""
    cap = _cap(caps, own)
    cos_t, sin_t = cap[4] * np.cos(t), cap[4] * np.sin(t)
    x = cap[3] * cap[0] + cos_t * u[0] + sin_t * v[0]
    y = cap[3] * cap[1] + cos_t * u[1] + sin_t * v[1]
    z = cap[3] * cap[2] + cos_t * u[2] + sin_t * v[2]
    for j in range(len(caps)):
        other = _cap(caps, j)
        if j != own and x * other[0] + y * other[1] + z * other[2] < other[3]:
            return False
    return True


@njit(cache=True, nogil=True)
def _cap(caps, index):  # type: ignore[no-untyped-def]
    """Return a cap as a tuple: a view of an array takes longer to make than two caps to compare."""
    return caps[index, 0], caps[index, 1], caps[index, 2], caps[index, 3], caps[index, 4]


@njit(cache=True, nogil=True)
def _set(caps, index, cap):  # type: ignore[no-untyped-def]
    for k in range(5):
        caps[index, k] = cap[k]


@njit(cache=True, nogil=True)
def _overlap(disc, cap):  # type: ignore[no-untyped-def]
    """Return 1 if a disc is wholly inside a cap, −1 if wholly outside, 0 if the cap's edge cuts it.

    Of angles δ between the axes, a and R: inside if δ ≤ R − a, outside if δ ≥ R + a.
    """
    cosine = _dot(disc, cap)
    even, odd = cap[3] * disc[3], cap[4] * disc[4]
    if cosine >= even + odd - _ROUNDING and disc[3] >= cap[3]:
        return 1
    if cosine <= even - odd + _ROUNDING and cap[3] + disc[3] > 0:  # R + a < π
        return -1
    return 0


@njit(cache=True, nogil=True)
def _orthonormal(axis):  # type: ignore[no-untyped-def]
    """Return unit vectors u and v with u × v = axis."""
    x, y, z = axis[0], axis[1], axis[2]
    if abs(y) < 0.9:
        length = np.sqrt(x * x + z * z)
        u = (z / length, 0.0, -x / length)
    else:
        length = np.sqrt(x * x + y * y)
        u = (-y / length, x / length, 0.0)
    v = (y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0])
    return u, v


@njit(cache=True, nogil=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
