"""Light of pictures in which everything moves: all of it, times the share that gets through.

What every light gives without shadow is summed exactly at every pixel. Of interleaved lights a
pixel takes over what its neighbours on the same surface saw, and scales the sum by the share of it
that they say gets through; where too little is known, it sends rays of its own.

Cost   : about 0.1 µs per pixel and 64 lights, 0.3 µs where it mirrors them; see open_ground.py.
"""

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.moving.light_weights import weigh_dull, weigh_glossy, weighed_sum
from render.moving.neighbours import (
    average_keys,
    borrow,
    compare,
    find_places,
    find_turns,
    load_packet,
    low,
)
from render.moving.own_rays import ask_for_unknown
from render.moving.shadow_rays import ALL_PASSES, UNKNOWN
from render.rays.embree import PACKET, packet
from render.rays.row_order import row_order
from render.rays.surface_rows import FIELDS, GLOSSY, KIND, LANES, MATT, NORMAL, NOTHING, SIDE

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FLAGS = NDArray[np.bool_]
_LEAST_KNOWN = np.float32(0.5)  # of the light without shadow; below that a pixel asks for itself
_ENOUGH_KNOWN = np.float32(0.7)  # of it, when it has asked
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
        Which tiles are left out, as `add_to_ground` sees to them.
    is_soft : (J,) bool
        Whether a key light's visibility is the mean over the 4 × 4 pixels around.
    eye : (3,) float32
    pixel_rad : float
        Angle between neighbouring pixels.
    rough_alpha2 : float
        Surfaces from this α² on mirror all of a light's irradiance; smoother ones what its row
        MIRRORED says, because something else shows them the rest.
    """
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        _add_row(
            function, scene, np.float32(offset_m), surfaces, is_open, keys, shared, lights, points,
            is_soft, side, eye, np.float32(pixel_rad), np.float32(rough_alpha2), order[k], picture,
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
    seen = np.empty(lights.shape[1] - key_count, np.uint8)
    per_turn, columns = shared.shape[3], shared.shape[2]
    pairs, seen_pairs = _in_pairs(shared, per_turn), _in_pairs(seen, per_turn)
    turns = len(seen) // max(per_turn, 1)
    near_of, places = np.empty(turns, np.int64), np.empty(turns, np.uint64)
    weights = np.empty((3, lights.shape[1]), np.float32)
    normals = np.zeros(6, np.float32)
    rays, valid = packet()
    for lane in range(LANES):
        x, y = lane % SIDE, lane // SIDE
        line = SIDE * (row - 1) + y
        if line >= height:
            continue
        find_turns(x, y, side, near_of)
        find_places(row, x, y, columns, near_of, places)
        for first in range(1, surfaces.shape[3] - 1, PACKET):
            open_there = is_open[row, first : first + PACKET]
            if open_there.all() or not load_packet(surfaces[row], lane, first, part):
                continue
            compare(
                surfaces, row, x + low(x), y + low(y), 1, SIDE, first, pixel_rad, eye, part, like
            )
            for light in range(key_count):
                if is_soft[light]:
                    average_keys(keys, row, x, y, first, light, like, of_keys)
                else:
                    of_keys[light] = keys[row, lane, light, first : first + PACKET]
            for i in range(min(PACKET, (width - x + SIDE - 1) // SIDE - first + 1)):
                column, kind = SIDE * (first - 1 + i) + x, part[KIND, i]
                if kind == NOTHING or open_there[i]:
                    continue
                borrow(pairs, places, first + i, seen_pairs)
                if kind == GLOSSY:
                    weigh_glossy(part, i, eye, lights, rough_alpha2, weights)
                elif not _is_as(part, i, normals):
                    weigh_dull(part, i, lights, weights)
                _note(part, i, kind == GLOSSY, normals)
                if _knows_all(near_of, like, i, seen):
                    r, g, b = weighed_sum(weights, key_count, seen)
                    r, g, b = _SHARE * r, _SHARE * g, _SHARE * b
                else:
                    r, g, b = _shared(
                        function, scene, offset_m, part, i, points, weights, key_count,
                        line + column, near_of, like, seen, rays, valid,
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
def _in_pairs(seen: NDArray[Any], per_turn: int) -> NDArray[Any]:  # pragma: no cover - compiled
    """Return bytes (…, per_turn) two at a time, (turns, per_turn // 2) uint16."""
    pairs = max(per_turn // 2, 1)
    return seen.ravel().view(np.uint16).reshape(seen.size // 2 // pairs, pairs)


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
def _knows_all(
    near_of: NDArray[np.int64], like: _FLOATS, i: int, seen: _BYTES
) -> bool:  # pragma: no cover - compiled
    """Whether all neighbours that a pixel asks lie on its surface, and know."""
    are_like = True
    for near in near_of:
        are_like &= like[near, i] > 0
    most = np.uint8(0)
    for k in range(np.uint64(len(seen))):
        most = max(most, seen[k])
    return are_like and most != UNKNOWN


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
    _tell_known(near_of, like, i, seen, known)
    first, zero = np.uint64(key_count), np.float32(0)
    rt = gt = bt = rk = gk = bk = rs = gs = bs = zero
    for k in range(np.uint64(len(seen))):
        red, green, blue = weights[0, first + k], weights[1, first + k], weights[2, first + k]
        is_known, passes = np.float32(known[k]), np.float32(seen[k])
        rt, gt, bt = rt + red, gt + green, bt + blue
        rk, gk, bk = rk + is_known * red, gk + is_known * green, bk + is_known * blue
        rs, gs, bs = rs + passes * red, gs + passes * green, bs + passes * blue
    total, told = rt + gt + bt, rk + gk + bk
    if told < _LEAST_KNOWN * total:
        ask_for_unknown(
            function, scene, offset_m, part, i, points, weights, key_count, len(near_of),
            _ENOUGH_KNOWN * total - told, turn, known, seen, rays, valid,
        )  # fmt: skip
        rk, gk, bk = weighed_sum(weights, key_count, known)
        rs, gs, bs = weighed_sum(weights, key_count, seen)
    r = _SHARE * rt * rs / rk if rk > 0 else zero
    g = _SHARE * gt * gs / gk if gk > 0 else zero
    b = _SHARE * bt * bs / bk if bk > 0 else zero
    return r, g, b


@njit(nogil=True, error_model="numpy")
def _tell_known(
    near_of: NDArray[np.int64], like: _FLOATS, i: int, seen: _BYTES, known: _BYTES
) -> None:  # pragma: no cover - compiled
    """Set `known` to 1 for lights of which pixel `i` learns from its surface; `seen` else to 0."""
    per_turn = np.uint64(len(seen) // len(near_of))
    at = np.uint64(0)
    for near in near_of:
        is_like = np.uint8(like[near, i] > 0)
        for slot in range(per_turn):
            known[at + slot] = is_like
        at += per_turn
    for k in range(np.uint64(len(seen))):
        known[k] = known[k] if seen[k] != UNKNOWN else np.uint8(0)
        seen[k] = seen[k] if known[k] else np.uint8(0)
