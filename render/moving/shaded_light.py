"""Light of pictures in which everything moves: all of it, times the share that gets through.

What every light gives without shadow is summed exactly at every pixel. Of interleaved lights a
pixel takes over what its neighbours on the same surface saw, and scales the sum by the share of it
that they say gets through; where too little is known, it sends rays of its own.

Cost   : about 0.15 µs per pixel and 64 lights, 0.3 µs where it mirrors.
"""

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.moving.light_weights import weigh_dull, weigh_glossy, weighed_sum
from render.moving.neighbours import average_visible, compare, find_turns, load_packet, low
from render.moving.shadow_rays import POINTS
from render.rays.embree import PACKET, occluded16, packet
from render.rays.first_hits import (
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
_LEAST_KNOWN = np.float32(0.5)  # of the light without shadow; below that a pixel asks for itself


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
    rough_alpha2: float,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add radiance toward the eye to `picture` (H, W, 4) where a surface is seen.

    Parameters
    ----------
    surfaces, visible, lights, key_count, side
        As in `trace_lights`.
    is_soft : (K,) bool
        Whether a key light's visibility is the mean over the 4 × 4 pixels around.
    eye : (3,) float32
    pixel_rad : float
        Angle between neighbouring pixels.
    rough_alpha2 : float
        Surfaces from this α² on mirror all of a light's irradiance; smoother ones what its row
        MIRRORED says, because something else shows them the rest.
    """
    for row in prange(1, surfaces.shape[0] - 1):
        _add_row(
            function, scene, sphere, np.float32(offset_m), surfaces, visible, lights, points,
            is_soft, key_count, side, eye, np.float32(pixel_rad), np.float32(rough_alpha2), row,
            picture,
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
    rough_alpha2: np.float32,
    row: int,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((LANES, PACKET), np.float32)
    known = np.ones((PACKET, lights.shape[1]), np.float32)
    seen = np.empty((PACKET, lights.shape[1]), np.float32)
    near_of = np.empty(side * side, np.int64)
    knows_all = np.empty(PACKET, np.bool_)
    weights = np.empty((3, lights.shape[1]), np.float32)
    normals = np.zeros(6, np.float32)
    rays, valid = packet()
    for lane in range(LANES):
        x, y = lane % SIDE, lane // SIDE
        line = SIDE * (row - 1) + y
        if line >= height:
            continue
        find_turns(x, y, side, near_of)
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            is_hit = load_packet(surfaces[row], lane, first, part)
            if not is_hit:
                continue
            compare(
                surfaces, row, x + low(x), y + low(y), 1, SIDE, first, pixel_rad, eye, part, like
            )
            count = min(PACKET, (width - x + SIDE - 1) // SIDE - first + 1)
            _find_those_who_know_all(near_of, like, knows_all)
            _gather(
                visible, row, x, y, first, key_count, side, is_soft, near_of, like, knows_all,
                known, seen,
            )  # fmt: skip
            for i in range(count):
                if part[KIND, i] == NOTHING:
                    continue
                column = SIDE * (first - 1 + i) + x
                mirrors = part[KIND, i] == GLOSSY
                if mirrors:
                    weigh_glossy(part, i, eye, lights, rough_alpha2, weights)
                elif not _is_as(part, i, normals):
                    weigh_dull(part, i, lights, weights)
                _note(part, i, mirrors, normals)
                if knows_all[i]:
                    r, g, b = weighed_sum(weights, 0, lights.shape[1], seen, i)
                else:
                    r, g, b = _shared(
                        function, scene, sphere, offset_m, part, i, points, weights, key_count,
                        line + column, known, seen, rays, valid,
                    )  # fmt: skip
                picture[line, column, 0] += r if mirrors else part[MATT, i] * r
                picture[line, column, 1] += g if mirrors else part[MATT + 1, i] * g
                picture[line, column, 2] += b if mirrors else part[MATT + 2, i] * b


@njit(nogil=True, error_model="numpy")
def _is_as(part: _FLOATS, i: int, normals: _FLOATS) -> bool:  # pragma: no cover - compiled
    """Whether the normals of pixel `i` are those noted before, as on a flat surface."""
    same = True
    for axis in range(6):
        same &= part[NORMAL + axis, i] == normals[axis]
    return same


@njit(nogil=True, error_model="numpy")
def _note(part: _FLOATS, i: int, mirrors: bool, normals: _FLOATS) -> None:  # pragma: no cover
    """Keep the normals that weights are of; those of what mirrors serve no other pixel."""
    for axis in range(6):
        normals[axis] = np.float32(0) if mirrors else part[NORMAL + axis, i]


@njit(nogil=True, error_model="numpy")
def _find_those_who_know_all(
    near_of: NDArray[np.int64], like: _FLOATS, knows_all: NDArray[np.bool_]
) -> None:  # pragma: no cover - compiled
    """Set for which pixels all neighbours that they ask lie on their surface."""
    knows_all[:] = True
    for near in near_of:
        for i in range(PACKET):
            knows_all[i] &= like[near, i] > 0


@njit(nogil=True, error_model="numpy")
def _shared(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    part: _FLOATS,
    i: int,
    points: _FLOATS,
    weights: _FLOATS,
    key_count: int,
    turn: int,
    known: _FLOATS,
    seen: _FLOATS,
    rays: _FLOATS,
    valid: NDArray[np.int32],
) -> tuple[Any, ...]:  # pragma: no cover - compiled
    """Return the sums (3) of a pixel that knows of some lights only what share gets through."""
    stop = weights.shape[1]
    r, g, b = weighed_sum(weights, 0, key_count, seen, i)
    rk, gk, bk = weighed_sum(weights, key_count, stop, known, i)
    rt = gt = bt = np.float32(0)
    for k in range(key_count, stop):
        rt, gt, bt = rt + weights[0, k], gt + weights[1, k], bt + weights[2, k]
    if rk + gk + bk < _LEAST_KNOWN * (rt + gt + bt):
        _fill_in(
            function, scene, sphere, offset_m, part, i, weights, points, key_count, turn, known,
            seen, rays, valid,
        )  # fmt: skip
        rk, gk, bk = weighed_sum(weights, key_count, stop, known, i)
    rs, gs, bs = weighed_sum(weights, key_count, stop, seen, i)
    r += rt * rs / rk if rk > 0 else np.float32(0)
    g += gt * gs / gk if gk > 0 else np.float32(0)
    b += bt * bs / bk if bk > 0 else np.float32(0)
    return r, g, b


@njit(nogil=True, error_model="numpy")
def _fill_in(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: np.float32,
    part: _FLOATS,
    i: int,
    weights: _FLOATS,
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
    for first in range(key_count, weights.shape[1], PACKET):
        count = min(PACKET, weights.shape[1] - first)
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
    knows_all: NDArray[np.bool_],
    known: _FLOATS,
    seen: _FLOATS,
) -> None:  # pragma: no cover - compiled
    per_turn = visible.shape[3] - key_count
    lane = y * SIDE + x
    for slot in range(key_count):
        for i in range(PACKET):
            seen[i, slot] = visible[row, lane, first + i, slot]
            if is_soft[slot]:
                seen[i, slot] = average_visible(visible, row, x, y, first + i, slot, like, i)
    for turn in range(side * side):
        near = near_of[turn]
        qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
        to, keys = np.uint64(key_count + turn * per_turn), np.uint64(key_count)
        from_row, from_lane = row + (qy >> 2), (qy & 3) * SIDE + (qx & 3)
        at = first + (qx >> 2)
        if per_turn % 4:
            for j in range(np.uint64(per_turn)):
                for i in range(PACKET):
                    seen[i, to + j] = visible[from_row, from_lane, at + i, keys + j]
            continue
        for i in range(PACKET):
            # Four at a time, all read before any is written: so they are moved as one.
            for j in range(np.uint64(0), np.uint64(per_turn), np.uint64(4)):
                k, at_k = to + j, keys + j
                a = visible[from_row, from_lane, at + i, at_k]
                b = visible[from_row, from_lane, at + i, at_k + _ONE]
                c = visible[from_row, from_lane, at + i, at_k + _TWO]
                d = visible[from_row, from_lane, at + i, at_k + _THREE]
                seen[i, k], seen[i, k + _ONE], seen[i, k + _TWO], seen[i, k + _THREE] = a, b, c, d
    if knows_all.all():
        return
    for turn in range(side * side):
        first_of, next_of = key_count + turn * per_turn, key_count + (turn + 1) * per_turn
        for i in range(PACKET):
            share = like[near_of[turn], i]
            for slot in range(np.uint64(first_of), np.uint64(next_of)):
                known[i, slot] = share
                seen[i, slot] *= share
