"""Light of pictures in which everything moves: all of it, times the share that gets through.

What every light gives without shadow is summed exactly at every pixel. Of interleaved lights a
pixel takes over what its neighbours on the same surface saw, and scales the sum by the share of it
that they say gets through; where too little is known, it sends rays of its own.

Cost   : about 0.1 µs per pixel and 64 lights.
"""

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.moving.light_weights import weigh_dull, weigh_glossy, weighed_sum
from render.moving.neighbours import average_keys, borrow, compare, find_turns, load_packet, low
from render.moving.own_rays import ask_for_unknown
from render.moving.shadow_rays import ALL_PASSES, LOOSE, UNKNOWN
from render.rays.embree import PACKET, packet
from render.rays.first_hits import FIELDS, GLOSSY, KIND, LANES, MATT, NORMAL, NOTHING, SIDE

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FLAGS = NDArray[np.bool_]
_LEAST_KNOWN = np.float32(0.5)  # of the light without shadow; below that a pixel asks for itself
_SHARE = np.float32(1 / ALL_PASSES)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_lights(
    function: int,
    scene: int,
    offset_m: float,
    surfaces: _FLOATS,
    is_open: _FLAGS,
    keys: _FLOATS,
    shared: _BYTES,
    lights: _FLOATS,
    points: _FLOATS,
    is_soft: _FLAGS,
    side: int,
    eye: _FLOATS,
    pixel_rad: float,
    rough_alpha2: float,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add radiance toward the eye to `picture` (H, W, 4) where a surface is seen.

    Parameters
    ----------
    function, scene : int
        Addresses of Embree's rtcOccluded16 and scene.
    offset_m, surfaces, lights, points, side, keys, shared
        As in `trace_lights`.
    is_open : (rows, columns) bool
        As of `open_ground`.
    is_soft : (J,) bool
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
            function, scene, np.float32(offset_m), surfaces, is_open, keys, shared, lights, points,
            is_soft, side, eye, np.float32(pixel_rad), np.float32(rough_alpha2), row, picture,
        )  # fmt: skip


@njit(nogil=True, error_model="numpy")
def _add_row(
    function: int,
    scene: int,
    offset_m: np.float32,
    surfaces: _FLOATS,
    is_open: _FLAGS,
    keys: _FLOATS,
    shared: _BYTES,
    lights: _FLOATS,
    points: _FLOATS,
    is_soft: _FLAGS,
    side: int,
    eye: _FLOATS,
    pixel_rad: np.float32,
    rough_alpha2: np.float32,
    row: int,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    key_count = len(is_soft)
    part = np.empty((FIELDS, PACKET), np.float32)
    like = np.empty((LANES, PACKET), np.float32)
    of_keys = np.empty((key_count, PACKET), np.float32)
    seen = np.empty((PACKET, lights.shape[1] - key_count), np.uint8)
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
            if not load_packet(surfaces[row], lane, first, part):
                continue
            if is_open[row, first : first + PACKET].all():
                like[:] = 1
                knows_all[:] = True
                borrow(shared, row, x, y, first, near_of, seen)
            else:
                compare(
                    surfaces, row, x + low(x), y + low(y), 1, SIDE, first, pixel_rad, eye, part,
                    like,
                )  # fmt: skip
                borrow(shared, row, x, y, first, near_of, seen)
                _find_those_who_know_all(near_of, like, seen, knows_all)
            for light in range(key_count):
                if is_soft[light]:
                    average_keys(keys, row, x, y, first, light, like, of_keys)
                else:
                    of_keys[light] = keys[row, lane, light, first : first + PACKET]
            for i in range(min(PACKET, (width - x + SIDE - 1) // SIDE - first + 1)):
                column, kind = SIDE * (first - 1 + i) + x, part[KIND, i]
                if kind == NOTHING:
                    continue
                if kind == GLOSSY:
                    weigh_glossy(part, i, eye, lights, rough_alpha2, weights)
                elif not _is_as(part, i, normals):
                    weigh_dull(part, i, lights, weights)
                _note(part, i, kind == GLOSSY, normals)
                if knows_all[i]:
                    r, g, b = weighed_sum(weights, key_count, seen[i])
                    r, g, b = _SHARE * r, _SHARE * g, _SHARE * b
                else:
                    r, g, b = _shared(
                        function, scene, offset_m, part, i, points, weights, key_count,
                        line + column, near_of, like, seen[i], rays, valid,
                    )  # fmt: skip
                for k in range(key_count):
                    share = of_keys[k, i]
                    r += share * weights[0, k]
                    g += share * weights[1, k]
                    b += share * weights[2, k]
                mirrors = kind == GLOSSY
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
    near_of: NDArray[np.int64], like: _FLOATS, seen: _BYTES, knows_all: _FLAGS
) -> None:  # pragma: no cover - compiled
    """Set for which pixels all neighbours that they ask lie on their surface, and know."""
    knows_all[:] = True
    for near in near_of:
        for i in range(PACKET):
            knows_all[i] &= like[near, i] > 0
    for i in range(PACKET):
        most = np.uint8(0)
        for k in range(seen.shape[1]):
            most = max(most, seen[i, k])
        knows_all[i] &= most != UNKNOWN


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _shared(
    function: int,
    scene: int,
    offset_m: np.float32,
    part: _FLOATS,
    i: int,
    points: _FLOATS,
    weights: _FLOATS,
    key_count: int,
    turn: int,
    near_of: NDArray[np.int64],
    like: _FLOATS,
    seen: _BYTES,
    rays: _FLOATS,
    valid: NDArray[np.int32],
) -> tuple[Any, ...]:  # pragma: no cover - compiled
    """Return the sums (3) of a pixel that knows of some lights only what share gets through."""
    known = np.empty(len(seen), np.uint8)
    per_turn = len(seen) // len(near_of)
    for k in range(len(seen)):
        known[k] = np.uint8(like[near_of[k // per_turn], i] > 0 and seen[k] != UNKNOWN)
        seen[k] *= known[k]
    rk, gk, bk = weighed_sum(weights, key_count, known)
    rt = gt = bt = np.float32(0)
    for k in range(key_count, weights.shape[1]):
        rt, gt, bt = rt + weights[0, k], gt + weights[1, k], bt + weights[2, k]
    if rk + gk + bk < _LEAST_KNOWN * (rt + gt + bt):
        ask_for_unknown(
            function, scene, offset_m, part, i, points, weights, key_count, turn, known, seen,
            rays, valid,
        )  # fmt: skip
        rk, gk, bk = weighed_sum(weights, key_count, known)
    rs, gs, bs = weighed_sum(weights, key_count, seen)
    r = _SHARE * rt * rs / rk if rk > 0 else np.float32(0)
    g = _SHARE * gt * gs / gk if gk > 0 else np.float32(0)
    b = _SHARE * bt * bs / bk if bk > 0 else np.float32(0)
    return r, g, b
