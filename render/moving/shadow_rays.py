"""Shadow rays of pictures in which everything moves.

A light is either a key light, towards which every pixel sends rays, or one that is interleaved: one
pixel of each square of n × n sends a ray to it. Packets hold the pixels of one lane in 4 × 4 tiles:
they send rays to the same light, from near each other.

Input  : surfaces, as `first_hits` finds them, and lights.
Output : what share of each pixel's rays gets through.
Cost   : about 35 ns per ray.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.embree import PACKET, coherent16, packet
from render.rays.first_hits import FACE_NORMAL, FIELDS, KIND, LANES, NORMAL, NOTHING, POSITION, SIDE

_FLOATS = NDArray[np.float32]
_FAR_M = np.float32(1e30)
LOOSE = {"contract", "reassoc", "nnan", "ninf", "nsz", "arcp"}
"""Freedoms of arithmetic under which loops and sums are vectorised; nothing here is NaN."""

POINTS = 16
"""Points of a disc that neighbouring pixels take turns in."""

# Which point is whose turn, in squares of 4 × 4 pixels: along a Z, so that the points of each
# square of 2 × 2 are spread over the disc, and those of all 16.
_TURN = np.array([[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]], np.int64)

DIRECTION, IRRADIANCE, MIRRORED, HALF, SINE, CURVE, SPREAD, WIDTH = 0, 3, 6, 9, 10, 11, 14, 15
"""Rows of a table of lights: direction (3), irradiance (3), the irradiance that mirrors show (3),
the irradiance curve of discs.py (half, s, then −1/s², p and q), what widens α²; and how many rows
there are."""


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def trace_lights(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: float,
    surfaces: _FLOATS,
    lights: _FLOATS,
    points: _FLOATS,
    ray_count: NDArray[np.int64],
    key_count: int,
    side: int,
    visible: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Fill `visible` (rows, LANES, columns, slots): the share of each pixel's rays that pass.

    Parameters
    ----------
    function, scene : int
        Addresses of Embree's rtcOccluded16 and scene.
    sphere : (4,) float32
        Centre and radius of the triangles' bounding sphere.
    offset_m : float
        How far off their surface rays start.
    surfaces : (rows, LANES, FIELDS, columns) float32
    lights : (WIDTH, K) float32
        First the key lights, then those of each turn, as many in every turn.
    points : (K, S, 3) float32
        Directions, spread over each light's disc; multiples of POINTS are used of them.
    ray_count : (K,) int64
        Rays of a pixel to each; none to one without power.
    key_count : int
    side : int
        n: 1, 2 or 4.
    """
    for square in prange((surfaces.shape[0] - 2) // SIDE):
        _trace_row(
            function, scene, sphere, np.float32(offset_m), surfaces, lights, points,
            ray_count, key_count, side, 1 + SIDE * square, visible,
        )  # fmt: skip


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _trace_row(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    surfaces: _FLOATS,
    lights: _FLOATS,
    points: _FLOATS,
    ray_count: NDArray[np.int64],
    key_count: int,
    side: int,
    row: int,
    visible: _FLOATS,
) -> None:  # pragma: no cover - compiled
    rays, valid = packet()
    part = np.empty((FIELDS, PACKET), np.float32)
    share = np.empty(PACKET, np.float32)
    per_turn = visible.shape[3] - key_count
    for lane in range(LANES):
        x, y = lane % SIDE, SIDE * row + lane // SIDE
        turn = y % side * side + x % side
        for first in range(1, surfaces.shape[3] - 1, SIDE):
            if not _load_square(surfaces, row, lane, first, part):
                continue
            _start(part, offset_m, rays)
            for slot in range(visible.shape[3]):
                is_key = slot < key_count
                light = slot if is_key else slot + per_turn * turn
                step = 1 if is_key else side
                share[:] = 0
                for ray in range(ray_count[light]):
                    _aim(
                        points,
                        light,
                        ray,
                        ray_count[light],
                        (SIDE * first + x) // step,
                        y // step,
                        SIDE // step,
                        rays,
                    )
                    if _select(part, sphere, lights, light, rays, valid):
                        coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                    for i in range(np.uint64(part.shape[1])):
                        share[i] += np.float32(rays[8, i] > 0)
                scale = np.float32(1) / np.float32(max(ray_count[light], 1))
                for i in range(PACKET):
                    visible[row + i // SIDE, lane, first + i % SIDE, slot] = scale * share[i]


@njit(nogil=True, error_model="numpy")
def _aim(
    points: _FLOATS,
    light: int,
    ray: int,
    ray_count: int,
    column: int,
    line: int,
    stride: int,
    rays: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Point the rays at the points of a light's disc whose turn it is, of 4 × 4 pixels.

    Points in a row are a pixel's own, as those are spread over the disc.
    """
    column, line = column + light, line + light // 4
    for i in range(PACKET):
        turn = _TURN[(line + stride * (i // SIDE)) & 3, (column + stride * (i % SIDE)) & 3]
        which = ray_count * turn + ray
        for axis in range(3):
            rays[4 + axis, i] = points[light, which, axis]


@njit(nogil=True, error_model="numpy")
def _load_square(
    surfaces: _FLOATS, row: int, lane: int, first: int, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Copy the surfaces of a lane's pixels in 4 × 4 tiles; return whether there is one."""
    some = np.float32(0)
    for i in range(PACKET):
        some = max(some, surfaces[row + i // SIDE, lane, KIND, first + i % SIDE])
    if some == NOTHING:
        return False
    for field in range(FACE_NORMAL + 3):
        for i in range(PACKET):
            part[field, i] = surfaces[row + i // SIDE, lane, field, first + i % SIDE]
    for i in range(PACKET):
        part[KIND, i] = surfaces[row + i // SIDE, lane, KIND, first + i % SIDE]
    return True


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _start(part: _FLOATS, offset_m: np.float32, rays: _FLOATS) -> None:  # pragma: no cover
    for axis in range(3):
        for i in range(np.uint64(part.shape[1])):
            rays[axis, i] = part[POSITION + axis, i] + offset_m * part[FACE_NORMAL + axis, i]


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _select(
    part: _FLOATS,
    sphere: _FLOATS,
    lights: _FLOATS,
    light: int,
    rays: _FLOATS,
    valid: NDArray[np.int32],
) -> bool:  # pragma: no cover - compiled
    """Mark the rays that may be blocked on their way to a light; return whether any may."""
    lx, ly, lz, sine = lights[0, light], lights[1, light], lights[2, light], lights[SINE, light]
    cx, cy, cz, radius = sphere[0], sphere[1], sphere[2], sphere[3]
    some = np.int32(0)
    for i in range(np.uint64(part.shape[1])):
        dx, dy, dz = rays[4, i], rays[5, i], rays[6, i]
        fx, fy, fz = part[FACE_NORMAL, i], part[FACE_NORMAL + 1, i], part[FACE_NORMAL + 2, i]
        # The part of a disc below the face's horizon is not seen; the ray goes to its mirror image.
        below = np.float32(2) * min(dx * fx + dy * fy + dz * fz, np.float32(0))
        dx, dy, dz = dx - below * fx, dy - below * fy, dz - below * fz
        ox, oy, oz = cx - rays[0, i], cy - rays[1, i], cz - rays[2, i]
        along = ox * dx + oy * dy + oz * dz
        off2 = ox * ox + oy * oy + oz * oz - along * along
        facing = fx * lx + fy * ly + fz * lz
        cosine = part[NORMAL, i] * lx + part[NORMAL + 1, i] * ly + part[NORMAL + 2, i] * lz
        meets = (off2 < radius * radius) & (along > -radius)
        valid[i] = -np.int32(meets & (facing > -sine) & (cosine > -sine) & (part[KIND, i] > 0))
        rays[4, i], rays[5, i], rays[6, i], rays[8, i] = dx, dy, dz, _FAR_M
        some |= valid[i]
    return some != 0
