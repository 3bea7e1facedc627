"""Shadow rays of pictures in which everything moves.

A light is either a key light, towards which every pixel sends rays, or one that is interleaved: one
pixel of each square of n × n sends a ray to it. Packets hold the pixels of one tile, and those of
one lane in 16 tiles: they send rays to the same light, from near each other.

Input  : surfaces, as `first_hits` finds them, and lights.
Output : what share of each pixel's rays gets through.
Cost   : about 35 ns per ray.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.rays.embree import PACKET, coherent16, occluded16, packet
from render.rays.row_order import row_order
from render.rays.surface_rows import (
    FACE_NORMAL,
    FIELDS,
    KIND,
    LANES,
    NORMAL,
    NOTHING,
    POSITION,
    SIDE,
)

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FAR_M = np.float32(1e30)
POINTS = 16
"""Points of a disc that neighbouring pixels take turns in."""

ALL_PASSES = 240
"""What stands for all of a light in bytes: a multiple of 8, so that means of tiles are whole."""

UNKNOWN = 255
"""What stands, instead, for a light that nobody on a pixel's surface has sent rays to."""

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
    key_rays: NDArray[np.int64],
    is_sparing: bool,
    side: int,
    is_staggered: bool,
    keys: _FLOATS,
    shared: _BYTES,
) -> None:  # pragma: no cover - compiled
    """Fill `keys` and `shared` with the share of each pixel's rays that pass.

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
        First the key lights, then those of each turn, as many in every turn; there may be fewer
        turns than pixels that take them.
    points : (K, S, 3) float32
        Directions, spread over each light's disc; multiples of POINTS are used of them.
    key_rays : (J,) int64
        Rays of a pixel to each key light.
    is_sparing : bool
        Whether pixels of a tile that agree on a key light by one ray each send no others to it.
    side : int
        n: 1, 2 or 4.
    is_staggered : bool
        Whether only every second tile sends rays to lights that are not key lights.
    keys : (rows, LANES, J, columns) float32
        Of the key lights.
    shared : (rows, LANES, columns, slots) uint8
        Of the lights whose turn a pixel is, in parts of `ALL_PASSES`.
    """
    squares = row_order(0, (surfaces.shape[0] - 2) // SIDE)
    for k in prange(len(squares)):
        first_row = 1 + SIDE * squares[k]
        for row in range(first_row, first_row + SIDE):
            _trace_keys(
                function, scene, sphere, np.float32(offset_m), surfaces, lights, points, key_rays,
                is_sparing, row, keys,
            )  # fmt: skip
        _trace_turns(
            function, scene, sphere, np.float32(offset_m), surfaces, lights, points, keys.shape[2],
            side, is_staggered, first_row, shared,
        )  # fmt: skip


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _trace_keys(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    surfaces: _FLOATS,
    lights: _FLOATS,
    points: _FLOATS,
    key_rays: NDArray[np.int64],
    is_sparing: bool,
    row: int,
    keys: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Send rays from every pixel of a row of tiles, in packets of one tile, to the key lights."""
    if len(key_rays) == 0:
        return
    rays, valid = packet()
    part = np.empty((FIELDS, PACKET), np.float32)
    share = np.empty(PACKET, np.float32)
    for column in range(1, surfaces.shape[3] - 1):
        if not _load_tile(surfaces, row, column, part):
            continue
        _start(part, offset_m, rays)
        for light in range(len(key_rays)):
            share[:] = 0
            count = key_rays[light]
            for ray in range(count):
                _aim(points, light, ray, count, 0, 0, 1, rays)
                if _select(part, sphere, lights, light, rays, valid):
                    coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                blocked = 0
                for i in range(np.uint64(PACKET)):
                    share[i] += np.float32(rays[8, i] > 0)
                    blocked += rays[8, i] < 0
                if ray == 0 and is_sparing and blocked % PACKET == 0:
                    share[:] *= count
                    break
            for lane in range(LANES):
                keys[row, lane, light, column] = share[lane] / count


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _trace_turns(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    surfaces: _FLOATS,
    lights: _FLOATS,
    points: _FLOATS,
    key_count: int,
    side: int,
    is_staggered: bool,
    row: int,
    shared: _BYTES,
) -> None:  # pragma: no cover - compiled
    """Send one ray from each pixel of four rows of tiles to each light whose turn it is."""
    rays, valid = packet()
    part = np.empty((FIELDS, PACKET), np.float32)
    per_turn, apart = shared.shape[3], 2 if is_staggered else 1
    if per_turn == 0:
        return
    for lane in range(LANES):
        x, y = lane % SIDE, SIDE * row + lane // SIDE
        start = key_count + turn_of(lane, side) * per_turn
        if start >= lights.shape[1]:
            continue
        for first in range(1, surfaces.shape[3] - 1, apart * SIDE):
            if not _load_tiles(surfaces, row, lane, first, apart, part):
                continue
            _start(part, offset_m, rays)
            column = (SIDE * (first // apart) + x) // side
            for slot in range(per_turn):
                light = start + slot
                _aim(points, light, 0, 1, column, y // side, SIDE // side, rays)
                shines = lights[IRRADIANCE : IRRADIANCE + 3, light].max() > 0
                if shines and _select(part, sphere, lights, light, rays, valid):
                    if is_staggered:  # to wide lights, from far apart: they soon part
                        occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                    else:
                        coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                for i in range(PACKET):
                    passes = np.uint8(ALL_PASSES * (not shines or rays[8, i] > 0))
                    down, right = tile_of(i, apart)
                    shared[row + down, lane, first + right, slot] = passes


@njit(nogil=True, error_model="numpy")
def turn_of(lane: int, side: int) -> int:  # pragma: no cover - compiled
    """Return whose turn it is, of side² pixels: that of the lights that pixels of a lane ask."""
    return lane // SIDE % side * side + lane % SIDE % side


@njit(nogil=True, error_model="numpy")
def tile_of(i: int, apart: int) -> tuple[int, int]:  # pragma: no cover - compiled
    """Return the row and column, in 4 × 4 or staggered 4 × 8 tiles, of a packet's pixel."""
    down = i // SIDE
    return down, apart * (i % SIDE) + (apart - 1) * (down % 2)


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

    Points in a row are a pixel's own, as those are spread over the disc. Which of them comes first
    differs from pixel to pixel, so that the first ones of sixteen are spread over it, too.
    """
    column, line = column + light, line + light // 4
    for i in range(PACKET):
        turn = _TURN[(line + stride * (i // SIDE)) & 3, (column + stride * (i % SIDE)) & 3]
        which = ray_count * turn + (ray ^ (turn >> 2 & (ray_count - 1)))
        for axis in range(3):
            rays[4 + axis, i] = points[light, which, axis]


@njit(nogil=True, error_model="numpy")
def _load_tile(
    surfaces: _FLOATS, row: int, column: int, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Copy the surfaces of a tile's pixels; return whether there is one."""
    some = np.float32(0)
    for lane in range(LANES):
        some = max(some, surfaces[row, lane, KIND, column])
    if some == NOTHING:
        return False
    for lane in range(LANES):
        for field in range(FACE_NORMAL + 3):
            part[field, lane] = surfaces[row, lane, field, column]
        part[KIND, lane] = surfaces[row, lane, KIND, column]
    return True


@njit(nogil=True, error_model="numpy")
def _load_tiles(
    surfaces: _FLOATS, row: int, lane: int, first: int, apart: int, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Copy the surfaces of a lane's pixels in 16 tiles; return whether there is one."""
    some = np.float32(0)
    for i in range(PACKET):
        down, right = tile_of(i, apart)
        some = max(some, surfaces[row + down, lane, KIND, first + right])
    if some == NOTHING:
        return False
    for field in range(FACE_NORMAL + 3):
        for i in range(PACKET):
            down, right = tile_of(i, apart)
            part[field, i] = surfaces[row + down, lane, field, first + right]
    for i in range(PACKET):
        down, right = tile_of(i, apart)
        part[KIND, i] = surfaces[row + down, lane, KIND, first + right]
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
