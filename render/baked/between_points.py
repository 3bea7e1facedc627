"""Light at what a picture shows, between points all over the scene that it was worked out for.

Input  : surfaces, as `first_hits` finds them; `SurfacePoints` and the irradiance there.
Output : radiance. Where each pixel lies is found for a lane's pixels at once, in vectors.
Cost   : about 15 ns a pixel.
Fails  : as in surface_points.py.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.baked.surface_points import GRIDS
from render.loose_arithmetic import LOOSE
from render.rays.row_order import row_order
from render.rays.surface_rows import (
    F0,
    F90,
    GROUND,
    KIND,
    MATT,
    NOTHING,
    POSITION,
    SIDE,
    TRIANGLE,
    U,
    V,
)

_FLOATS = NDArray[np.float32]

_HEMISPHERE_FRESNEL = np.float32(1 / 21)  # mean of (1 − n·l)⁵ over a Lambertian surface's light


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_irradiance(
    surfaces: _FLOATS,
    corners: NDArray[np.int32],
    steps: NDArray[np.int32],
    grids: _FLOATS,
    ground_start: int,
    irradiance: _FLOATS,
    unshaded: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add to `picture` (H, W, 4) what surfaces reflect evenly of the irradiance at points (P, 3).

    Parameters
    ----------
    surfaces : (rows, LANES, FIELDS + 3, columns) float32
        As `first_hits` finds them, with triangles.
    corners, steps, grids, ground_start
        Of `SurfacePoints`.
    unshaded : (3,) float32
        Irradiance of the ground beyond the grids.
    """
    order = row_order(0, picture.shape[0])
    for k in prange(len(order)):
        line, columns = order[k], surfaces.shape[3]
        points = np.empty((4, columns), np.int32)
        shares, reflected = np.empty((4, columns), np.float32), np.empty((3, columns), np.float32)
        for x in range(SIDE):  # along a lane, whose pixels lie side by side
            seen = surfaces[1 + line // SIDE, SIDE * (line % SIDE) + x]
            stop = 1 + (picture.shape[1] - x + SIDE - 1) // SIDE
            has_ground, has_triangles = _kinds(seen[KIND, 1:stop])
            if has_ground:
                _find_on_ground(seen, grids, ground_start, stop, points, shares)
            if has_triangles:
                _find_on_triangles(seen, corners, steps, stop, points, shares)
            if has_ground or has_triangles:
                _reflect(seen, stop, reflected)
                _add(
                    seen[KIND], points, shares, reflected, irradiance, unshaded, x, stop,
                    picture[line],
                )  # fmt: skip


@njit(nogil=True, error_model="numpy")
def _kinds(kinds: _FLOATS) -> tuple[bool, bool]:  # pragma: no cover - compiled
    """Whether the ground is among kinds of surfaces, and whether triangles are."""
    grounds, most = np.int32(0), np.float32(NOTHING)
    for at in range(np.uint64(len(kinds))):
        grounds |= np.int32(kinds[at] == GROUND)
        most = max(most, kinds[at])
    return bool(grounds > 0), bool(most > GROUND)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _find_on_ground(
    seen: _FLOATS,
    grids: _FLOATS,
    start: int,
    stop: int,
    points: NDArray[np.int32],
    shares: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set the four points around each pixel of a lane that shows the ground, and their shares.

    Its first point is −1 beyond the grids.
    """
    one, half = np.float32(1), np.float32(0.5) * grids[4]
    steps, side = np.int32(grids[4]), np.int32(grids[4]) + np.int32(1)
    for at in range(np.uint64(1), np.uint64(stop)):
        x, z = seen[POSITION, at] - grids[0], seen[POSITION + 2, at] - grids[1]
        most, half_m, grid = max(abs(x), abs(z)), grids[2], np.int32(0)
        for _ in range(GRIDS):
            is_out = most >= half_m
            grid += np.int32(is_out)
            half_m = half_m + half_m if is_out else half_m
        across, along = (x / half_m + one) * half, (z / half_m + one) * half
        i, j = min(np.int32(across), steps - np.int32(1)), min(np.int32(along), steps - np.int32(1))
        u, v = across - np.float32(i), along - np.float32(j)
        first = np.int32(start) + (grid * side + i) * side + j
        points[0, at] = np.int32(-1) if grid >= GRIDS else first
        points[1, at] = first + np.int32(1)
        points[2, at] = first + side
        points[3, at] = first + side + np.int32(1)
        shares[0, at], shares[1, at] = (one - u) * (one - v), (one - u) * v
        shares[2, at], shares[3, at] = u * (one - v), u * v


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _find_on_triangles(
    seen: _FLOATS,
    corners: NDArray[np.int32],
    steps: NDArray[np.int32],
    stop: int,
    points: NDArray[np.int32],
    shares: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set the points around each pixel of a lane that shows a triangle, and their shares.

    They are three; the fourth has no share.
    """
    one, single = np.float32(1), np.int32(1)
    triangles = seen[TRIANGLE].view(np.int32)
    for at in range(np.uint64(1), np.uint64(stop)):
        if triangles[at] < 0:
            continue
        face = np.uint64(triangles[at])
        count = steps[face]
        u, v = seen[U, at] * np.float32(count), seen[V, at] * np.float32(count)
        i = min(np.int32(u), count - single)
        j = min(np.int32(v), count - single - i)
        u, v = u - np.float32(i), v - np.float32(j)
        a = corners[face, 0] + i * (count + single) - (i * (i - single) >> single) + j
        b, c = a + count + single - i, a + single  # the rows below have one point fewer each
        if count == 1:
            b, c = corners[face, 1], corners[face, 2]
        elif u + v > one and i + j < count - single:
            a, u, v = b + single, one - v, one - u
        points[0, at], points[1, at], points[2, at], points[3, at] = a, b, c, a
        shares[0, at], shares[1, at], shares[2, at] = one - u - v, u, v
        shares[3, at] = 0


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _reflect(seen: _FLOATS, stop: int, reflected: _FLOATS) -> None:  # pragma: no cover - compiled
    """Set how much of their irradiance, over π, a lane's pixels reflect evenly."""
    for c in range(3):
        for at in range(np.uint64(1), np.uint64(stop)):
            f0 = seen[F0 + c, at]
            mirrored = f0 + (seen[F90, at] - f0) * _HEMISPHERE_FRESNEL
            reflected[c, at] = seen[MATT + c, at] * (np.float32(1) - mirrored)


@njit(nogil=True, error_model="numpy")
def _add(
    kinds: _FLOATS,
    points: NDArray[np.int32],
    shares: _FLOATS,
    reflected: _FLOATS,
    irradiance: _FLOATS,
    unshaded: _FLOATS,
    x: int,
    stop: int,
    line: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add to a lane's pixels in a line (W, 4) of the picture the light at points around them."""
    for at in range(np.uint64(1), np.uint64(stop)):
        if kinds[at] == NOTHING:
            continue
        column = np.uint64(SIDE) * (at - np.uint64(1)) + np.uint64(x)
        if kinds[at] == GROUND and points[0, at] < 0:
            for c in range(np.uint64(3)):
                line[column, c] += reflected[c, at] * unshaded[c]
            continue
        a, b = np.uint64(points[0, at]), np.uint64(points[1, at])
        d, e = np.uint64(points[2, at]), np.uint64(points[3, at])
        for c in range(np.uint64(3)):
            light = shares[0, at] * irradiance[a, c] + shares[1, at] * irradiance[b, c]
            light += shares[2, at] * irradiance[d, c] + shares[3, at] * irradiance[e, c]
            line[column, c] += reflected[c, at] * light
