"""Loops of pictures in which everything moves: shadow rays for some lights, light of all.

Surfaces come as `first_hits` finds them. A light is either a key light, towards which every pixel
sends rays, or one that is interleaved: one pixel of each square of n × n sends a ray to it, and
its neighbours take over what that saw if they lie on the same surface.
"""

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.embree import PACKET, coherent16, occluded16, packet
from render.first_hits import (
    ALPHA2,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    GLOSSY,
    KIND,
    LANES,
    MATT,
    NORMAL,
    NOTHING,
    POSITION,
    SIDE,
)

_FLOATS = NDArray[np.float32]
_FAR_M = np.float32(1e30)
_ONE, _TWO, _THREE = np.uint64(1), np.uint64(2), np.uint64(3)
_HALF_BY_PI = np.float32(0.5 / math.pi)
_LOOSE = {"contract", "reassoc", "nnan", "ninf", "nsz", "arcp"}
_SMALLEST_ALPHA2 = np.float32(4e-6)
_LEAST_AGREEMENT = np.float32(0.9)  # of the normals of one surface at neighbouring pixels
_MOST_OFF_PLANE = np.float32(3.0)  # in widths of a pixel there
_MOST_SLOPE2 = np.float32(0.15**2)  # and of the way to the neighbour: surfaces are curved

LEAST_KNOWN = np.float32(0.5)
POINTS = 16
"""Points of a disc that neighbouring pixels take turns in."""

# Which point is whose turn, in squares of 4 × 4 pixels: along a Z, so that the points of each
# square of 2 × 2 are spread over the disc, and those of all 16.
_TURN = np.array([[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]], np.int64)

# Rows of a light in the tables that `add_lights` takes.
DIRECTION, IRRADIANCE, HALF, SINE, CURVE, SPREAD, WIDTH = 0, 3, 6, 7, 8, 11, 12


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


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
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
    points: _FLOATS, light: int, ray: int, column: int, line: int, stride: int, rays: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Point the rays at the points of a light's disc whose turn it is: one in 4 × 4 for each."""
    column, line = column + light, line + light // 4
    for i in range(PACKET):
        which = (
            POINTS * ray
            + _TURN[(line + stride * (i // SIDE)) & 3, (column + stride * (i % SIDE)) & 3]
        )
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


@njit(nogil=True, error_model="numpy")
def _load(
    surfaces: _FLOATS, lane: int, first: int, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Copy the surfaces of a packet's pixels; return whether there is one."""
    some, at = np.float32(0), np.uint64(first)
    for i in range(np.uint64(part.shape[1])):
        some = max(some, surfaces[lane, KIND, at + i])
    if some == NOTHING:
        return False
    for field in range(FIELDS):
        for i in range(np.uint64(part.shape[1])):
            part[field, i] = surfaces[lane, field, at + i]
    return True


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
def _start(part: _FLOATS, offset_m: np.float32, rays: _FLOATS) -> None:  # pragma: no cover
    for axis in range(3):
        for i in range(np.uint64(part.shape[1])):
            rays[axis, i] = part[POSITION + axis, i] + offset_m * part[FACE_NORMAL + axis, i]


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
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


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def soften(
    surfaces: _FLOATS,
    visible: _FLOATS,
    key_count: int,
    eye: _FLOATS,
    pixel_rad: float,
    softened: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Fill `softened` with `visible`, that of soft lights averaged over like pixels of a lane.

    One ray to a wide disc tells little: nine tiles' rays go to nine of its points.
    """
    for row in prange(1, surfaces.shape[0] - 1):
        _soften_row(surfaces, visible, key_count, eye, np.float32(pixel_rad), row, softened)


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
def _soften_row(
    surfaces: _FLOATS,
    visible: _FLOATS,
    key_count: int,
    eye: _FLOATS,
    pixel_rad: np.float32,
    row: int,
    softened: _FLOATS,
) -> None:  # pragma: no cover - compiled
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((9, PACKET), np.float32)
    sums = np.empty((PACKET, visible.shape[3]), np.float32)
    count = np.empty(PACKET, np.float32)
    slots = np.uint64(visible.shape[3])
    for lane in range(LANES):
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            if not _load(surfaces[row], lane, first, part):
                continue
            count[:] = 0
            sums[:] = 0
            _compare(
                surfaces, row, lane % SIDE - SIDE, lane // SIDE - SIDE, SIDE, 3, first, pixel_rad,
                eye, part, like,
            )  # fmt: skip
            for near in range(9):
                down, right = near // 3 - 1, near % 3 - 1
                weight = np.float32((2 - abs(down)) * (2 - abs(right)))
                for i in range(PACKET):
                    w = weight * like[near, i]
                    count[i] += w
                    for slot in range(slots):
                        sums[i, slot] += w * visible[row + down, lane, first + right + i, slot]
            for i in range(PACKET):
                scale = np.float32(1) / max(count[i], np.float32(1))
                for slot in range(np.uint64(key_count)):
                    softened[row, lane, first + i, slot] = visible[row, lane, first + i, slot]
                for slot in range(np.uint64(key_count), slots):
                    softened[row, lane, first + i, slot] = scale * sums[i, slot]


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_lights(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: float,
    surfaces: _FLOATS,
    visible: _FLOATS,
    lights: _FLOATS,
    points: _FLOATS,
    is_soft: NDArray[np.bool_],
    key_count: int,
    side: int,
    eye: _FLOATS,
    pixel_rad: float,
    environment: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Fill `picture` (H, W, 4): radiance toward the eye, and 1 where a surface is seen.

    Parameters
    ----------
    surfaces, visible, lights, key_count, side
        As in `trace_lights`.
    is_soft : (K,) bool
        Whether a key light's visibility is the mean over the 4 × 4 pixels around.
    eye : (3,) float32
    pixel_rad : float
        Angle between neighbouring pixels.
    environment : (N, 2N, 3) float32
        What is seen where no surface is.
    """
    for row in prange(1, surfaces.shape[0] - 1):
        _add_row(
            function, scene, sphere, np.float32(offset_m), surfaces, visible, lights, points,
            is_soft, key_count, side, eye, np.float32(pixel_rad), environment, row, picture,
        )  # fmt: skip


@njit(nogil=True, error_model="numpy")
def _add_row(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    surfaces: _FLOATS,
    visible: _FLOATS,
    lights: _FLOATS,
    points: _FLOATS,
    is_soft: NDArray[np.bool_],
    key_count: int,
    side: int,
    eye: _FLOATS,
    pixel_rad: np.float32,
    environment: _FLOATS,
    row: int,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((LANES, PACKET), np.float32)
    known = np.ones((PACKET, lights.shape[1]), np.float32)
    seen = np.empty((PACKET, lights.shape[1]), np.float32)
    near_of = np.empty(side * side, np.int64)
    rays, valid = packet()
    for lane in range(LANES):
        x, y = lane % SIDE, lane // SIDE
        line = SIDE * (row - 1) + y
        if line >= height:
            continue
        _find_turns(x, y, side, near_of)
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            is_hit = _load(surfaces[row], lane, first, part)
            if is_hit:
                _compare(
                    surfaces,
                    row,
                    x + _low(x),
                    y + _low(y),
                    1,
                    SIDE,
                    first,
                    pixel_rad,
                    eye,
                    part,
                    like,
                )
            count = min(PACKET, (width - x + SIDE - 1) // SIDE - first + 1)
            if is_hit:
                _gather(
                    visible, row, x, y, first, key_count, side, is_soft, near_of, like, known, seen
                )
            for i in range(count):
                column = SIDE * (first - 1 + i) + x
                if not (is_hit and part[KIND, i] > 0):
                    _look_up(
                        environment,
                        surfaces[row, lane, POSITION, first + i],
                        surfaces[row, lane, POSITION + 1, first + i],
                        surfaces[row, lane, POSITION + 2, first + i],
                        line, column, picture,
                    )  # fmt: skip
                    continue
                is_glossy = part[KIND, i] == GLOSSY
                if is_glossy:
                    r, g, b, _, _, _, _, _, _ = _glossy(
                        part, i, eye, lights, 0, key_count, known, seen
                    )
                    rs, gs, bs, rk, gk, bk, rt, gt, bt = _glossy(
                        part, i, eye, lights, key_count, lights.shape[1], known, seen
                    )
                else:
                    r, g, b, _, _, _, _, _, _ = _dull(part, i, lights, 0, key_count, known, seen)
                    rs, gs, bs, rk, gk, bk, rt, gt, bt = _dull(
                        part, i, lights, key_count, lights.shape[1], known, seen
                    )
                if rk + gk + bk < LEAST_KNOWN * (rt + gt + bt):
                    _fill_in(
                        function, scene, sphere, offset_m, part, i, lights, points,
                        key_count, line + column, known, seen, rays, valid,
                    )  # fmt: skip
                    if is_glossy:
                        rs, gs, bs, rk, gk, bk, rt, gt, bt = _glossy(
                            part, i, eye, lights, key_count, lights.shape[1], known, seen
                        )
                    else:
                        rs, gs, bs, rk, gk, bk, rt, gt, bt = _dull(
                            part, i, lights, key_count, lights.shape[1], known, seen
                        )
                picture[line, column, 0] = r + (rt * rs / rk if rk > 0 else np.float32(0))
                picture[line, column, 1] = g + (gt * gs / gk if gk > 0 else np.float32(0))
                picture[line, column, 2] = b + (bt * bs / bk if bk > 0 else np.float32(0))
                picture[line, column, 3] = 1


@njit(nogil=True, error_model="numpy")
def _fill_in(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    part: _FLOATS,
    i: int,
    lights: _FLOATS,
    points: _FLOATS,
    key_count: int,
    turn: int,
    known: _FLOATS,
    seen: _FLOATS,
    rays: _FLOATS,
    valid: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Trace the lights that pixel `i` knows nothing about."""
    for axis in range(3):
        origin = part[POSITION + axis, i] + offset_m * part[FACE_NORMAL + axis, i]
        for ray in range(PACKET):
            rays[axis, ray] = origin
    fx, fy, fz = part[FACE_NORMAL, i], part[FACE_NORMAL + 1, i], part[FACE_NORMAL + 2, i]
    for first in range(key_count, lights.shape[1], PACKET):
        count = min(PACKET, lights.shape[1] - first)
        for ray in range(PACKET):
            valid[ray] = 0
        for ray in range(count):
            light = first + ray
            if known[i, light] > 0:
                continue
            which = (turn + light) % POINTS
            dx, dy, dz = points[light, which, 0], points[light, which, 1], points[light, which, 2]
            below = np.float32(2) * min(dx * fx + dy * fy + dz * fz, np.float32(0))
            rays[4, ray], rays[5, ray], rays[6, ray] = (
                dx - below * fx,
                dy - below * fy,
                dz - below * fz,
            )
            rays[8, ray] = _FAR_M
            valid[ray] = -1
        occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        for ray in range(count):
            light = first + ray
            if known[i, light] == 0:
                known[i, light] = 1
                seen[i, light] = np.float32(rays[8, ray] > 0)


@njit(nogil=True, error_model="numpy")
def _gather(
    visible: _FLOATS,
    row: int,
    x: int,
    y: int,
    first: int,
    key_count: int,
    side: int,
    is_soft: NDArray[np.bool_],
    near_of: NDArray[np.int64],
    like: _FLOATS,
    known: _FLOATS,
    seen: _FLOATS,
) -> None:  # pragma: no cover - compiled
    per_turn = visible.shape[3] - key_count
    lane = y * SIDE + x
    for slot in range(key_count):
        for i in range(PACKET):
            seen[i, slot] = visible[row, lane, first + i, slot]
            if is_soft[slot]:
                seen[i, slot] = _average(visible, row, x, y, first + i, slot, like, i)
    for turn in range(side * side):
        near = near_of[turn]
        qx, qy = x + near % SIDE + _low(x), y + near // SIDE + _low(y)
        to, keys = np.uint64(key_count + turn * per_turn), np.uint64(key_count)
        from_row, from_lane = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3)
        at = first + (qx >> 2)
        for i in range(PACKET):
            share = like[near, i]
            # Four at a time, all read before any is written: so they are moved as one.
            for j in range(np.uint64(0), np.uint64(per_turn), np.uint64(4)):
                k, at_k = to + j, keys + j
                a = visible[from_row, from_lane, at + i, at_k]
                b = visible[from_row, from_lane, at + i, at_k + _ONE]
                c = visible[from_row, from_lane, at + i, at_k + _TWO]
                d = visible[from_row, from_lane, at + i, at_k + _THREE]
                known[i, k] = known[i, k + _ONE] = share
                known[i, k + _TWO] = known[i, k + _THREE] = share
                seen[i, k], seen[i, k + _ONE] = share * a, share * b
                seen[i, k + _TWO], seen[i, k + _THREE] = share * c, share * d


@njit(nogil=True, error_model="numpy")
def _low(x: int) -> int:  # pragma: no cover - compiled
    """First column of the 4 × 4 pixels around a pixel, from it: −1 and −2 in turns."""
    return -1 - x // 2


@njit(nogil=True, error_model="numpy")
def _find_turns(x: int, y: int, side: int, near_of: NDArray[np.int64]) -> None:  # pragma: no cover
    """Set which pixel of the 4 × 4 around has each turn, the nearest if there are several."""
    for turn in range(side * side):
        best = 100
        for near in range(LANES):
            dx, dy = near % SIDE + _low(x), near // SIDE + _low(y)
            is_turn = (x + dx) % side == turn % side and (y + dy) % side == turn // side
            if is_turn and dx * dx + dy * dy < best:
                best = dx * dx + dy * dy
                near_of[turn] = near


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
def _compare(
    surfaces: _FLOATS,
    row: int,
    x: int,
    y: int,
    step: int,
    side: int,
    first: int,
    pixel_rad: np.float32,
    eye: _FLOATS,
    part: _FLOATS,
    like: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `like` (side², PACKET) to 1 for neighbours that lie on the same surface as `part`.

    These are a square of pixels `step` apart whose first is (x, y), counted from the tile's first.
    """
    most = (_MOST_OFF_PLANE * pixel_rad) ** 2
    ex, ey, ez = eye[0], eye[1], eye[2]
    for near in range(side * side):
        qx, qy = x + near % side * step, y + near // side * step
        r, q, at = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3), np.uint64(first + (qx >> 2))
        for i in range(np.uint64(part.shape[1])):
            nx, ny, nz = part[NORMAL, i], part[NORMAL + 1, i], part[NORMAL + 2, i]
            px, py, pz = part[POSITION, i], part[POSITION + 1, i], part[POSITION + 2, i]
            agreement = (
                nx * surfaces[r, q, NORMAL, at + i]
                + ny * surfaces[r, q, NORMAL + 1, at + i]
                + nz * surfaces[r, q, NORMAL + 2, at + i]
            )
            dx = surfaces[r, q, POSITION, at + i] - px
            dy = surfaces[r, q, POSITION + 1, at + i] - py
            dz = surfaces[r, q, POSITION + 2, at + i] - pz
            off = nx * dx + ny * dy + nz * dz
            apart = dx * dx + dy * dy + dz * dz
            px, py, pz = px - ex, py - ey, pz - ez
            away = px * px + py * py + pz * pz
            is_like = (
                (agreement > _LEAST_AGREEMENT)
                & (off * off < most * away + _MOST_SLOPE2 * apart)
                & (surfaces[r, q, KIND, at + i] > 0)
            )
            like[near, i] = np.float32(is_like)


@njit(nogil=True, error_model="numpy")
def _average(
    visible: _FLOATS, row: int, x: int, y: int, column: int, slot: int, like: _FLOATS, i: int
) -> np.float32:  # pragma: no cover - compiled
    """Return the mean visibility of a slot over the like ones of the 4 × 4 pixels around."""
    total = count = np.float32(0)
    for near in range(LANES):
        qx, qy = x + near % SIDE + _low(x), y + near // SIDE + _low(y)
        share = like[near, i]
        lane = (qy & 3) * SIDE + (qx & 3)
        total += share * visible[row + (qy >> 2), lane, column + (qx >> 2), slot]
        count += share
    return total / max(count, np.float32(1))


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
def _dull(
    part: _FLOATS,
    i: int,
    lights: _FLOATS,
    start: int,
    stop: int,
    known: _FLOATS,
    seen: _FLOATS,
) -> tuple[Any, ...]:  # pragma: no cover - compiled
    """Return the radiance of pixel `i` from lights, (9,): seen, known and all, of red, green, blue.

    What a light gives without shadow is that of shade.frag, times `seen`, `known` and 1.
    """
    zero, one = np.float32(0), np.float32(1)
    nx, ny, nz = part[NORMAL, i], part[NORMAL + 1, i], part[NORMAL + 2, i]
    fx, fy, fz = part[FACE_NORMAL, i], part[FACE_NORMAL + 1, i], part[FACE_NORMAL + 2, i]
    rs = gs = bs = rk = gk = bk = rt = gt = bt = zero
    for k in range(np.uint64(start), np.uint64(stop)):
        lx, ly, lz = lights[0, k], lights[1, k], lights[2, k]
        cosine = nx * lx + ny * ly + nz * lz
        facing = fx * lx + fy * ly + fz * lz
        sine = lights[SINE, k]
        t = max(one + cosine * cosine * lights[CURVE, k], zero)
        even = sine - t * (lights[CURVE + 1, k] + t * lights[CURVE + 2, k])
        level = lights[HALF, k] * (cosine + max(abs(cosine), even))
        level = level if facing > -sine else zero
        red, green, blue = level * lights[3, k], level * lights[4, k], level * lights[5, k]
        rt, gt, bt = rt + red, gt + green, bt + blue
        rk, gk, bk = rk + known[i, k] * red, gk + known[i, k] * green, bk + known[i, k] * blue
        rs, gs, bs = rs + seen[i, k] * red, gs + seen[i, k] * green, bs + seen[i, k] * blue
    r, g, b = part[MATT, i], part[MATT + 1, i], part[MATT + 2, i]
    return r * rs, g * gs, b * bs, r * rk, g * gk, b * bk, r * rt, g * gt, b * bt


@njit(nogil=True, fastmath=_LOOSE, error_model="numpy")
def _glossy(
    part: _FLOATS,
    i: int,
    eye: _FLOATS,
    lights: _FLOATS,
    start: int,
    stop: int,
    known: _FLOATS,
    seen: _FLOATS,
) -> tuple[Any, ...]:  # pragma: no cover - compiled
    """Do what `_dull` does for a surface that mirrors too."""
    zero, one = np.float32(0), np.float32(1)
    nx, ny, nz = part[NORMAL, i], part[NORMAL + 1, i], part[NORMAL + 2, i]
    fx, fy, fz = part[FACE_NORMAL, i], part[FACE_NORMAL + 1, i], part[FACE_NORMAL + 2, i]
    vx, vy, vz = eye[0] - part[0, i], eye[1] - part[1, i], eye[2] - part[2, i]
    scale = one / np.float32(math.sqrt(vx * vx + vy * vy + vz * vz))
    vx, vy, vz = vx * scale, vy * scale, vz * scale
    n_v = max(nx * vx + ny * vy + nz * vz, np.float32(1e-4))
    f90, alpha2 = part[F90, i], part[ALPHA2, i]
    f0r, f0g, f0b = part[F0, i], part[F0 + 1, i], part[F0 + 2, i]
    mr, mg, mb = part[MATT, i], part[MATT + 1, i], part[MATT + 2, i]
    rs = gs = bs = rk = gk = bk = rt = gt = bt = zero
    for k in range(np.uint64(start), np.uint64(stop)):
        lx, ly, lz = lights[0, k], lights[1, k], lights[2, k]
        cosine = nx * lx + ny * ly + nz * lz
        facing = fx * lx + fy * ly + fz * lz
        sine = lights[SINE, k]
        t = max(one + cosine * cosine * lights[CURVE, k], zero)
        even = sine - t * (lights[CURVE + 1, k] + t * lights[CURVE + 2, k])
        level = lights[HALF, k] * (cosine + max(abs(cosine), even))
        shown = one if facing > -sine else zero
        n_l = max(cosine, zero)
        hx, hy, hz = lx + vx, ly + vy, lz + vz
        scale = one / np.float32(math.sqrt(max(hx * hx + hy * hy + hz * hz, np.float32(1e-12))))
        hx, hy, hz = hx * scale, hy * scale, hz * scale
        v_h = min(max(vx * hx + vy * hy + vz * hz, zero), one)
        n_h = nx * hx + ny * hy + nz * hz
        a2 = min(max(alpha2 + lights[SPREAD, k], _SMALLEST_ALPHA2), one)
        # |n × h|² + α² (n·h)², without the cancellation of the usual form.
        kx, ky, kz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
        wide = kx * kx + ky * ky + kz * kz + a2 * n_h * n_h
        slanted = n_l * np.float32(math.sqrt(n_v * n_v * (one - a2) + a2)) + n_v * np.float32(
            math.sqrt(n_l * n_l * (one - a2) + a2)
        )
        mirrored = _HALF_BY_PI * a2 * n_l / (wide * wide * slanted)
        c = one - v_h
        c5 = c * c * c * c * c
        r, g, b = f0r + (f90 - f0r) * c5, f0g + (f90 - f0g) * c5, f0b + (f90 - f0b) * c5
        red = shown * lights[3, k] * ((one - r) * mr * level + r * mirrored)
        green = shown * lights[4, k] * ((one - g) * mg * level + g * mirrored)
        blue = shown * lights[5, k] * ((one - b) * mb * level + b * mirrored)
        rt, gt, bt = rt + red, gt + green, bt + blue
        rk, gk, bk = rk + known[i, k] * red, gk + known[i, k] * green, bk + known[i, k] * blue
        rs, gs, bs = rs + seen[i, k] * red, gs + seen[i, k] * green, bs + seen[i, k] * blue
    return rs, gs, bs, rk, gk, bk, rt, gt, bt


@njit(nogil=True, error_model="numpy")
def _look_up(
    environment: _FLOATS,
    x: np.float32,
    y: np.float32,
    z: np.float32,
    line: int,
    column: int,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set a pixel to a map's radiance, alpha 0: as background.look_up."""
    rows, columns = environment.shape[:2]
    u = (0.5 - math.atan2(x, z) / (2 * math.pi)) * columns - 0.5
    v = min(max(math.atan2(math.hypot(x, z), y) / math.pi * rows - 0.5, 0.0), rows - 1.0)
    left, above = math.floor(u), min(int(v), max(rows - 2, 0))
    right, down = u - left, v - above
    left, beside = int(left) % columns, (int(left) + 1) % columns
    below = min(above + 1, rows - 1)
    for c in range(3):
        upper = (1 - right) * environment[above, left, c] + right * environment[above, beside, c]
        lower = (1 - right) * environment[below, left, c] + right * environment[below, beside, c]
        picture[line, column, c] = (1 - down) * upper + down * lower
    picture[line, column, 3] = 0
