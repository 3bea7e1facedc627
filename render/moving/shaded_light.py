"""Light of pictures in which everything moves: all of it, times the share that gets through.

What every light gives without shadow is summed exactly at every pixel. Of interleaved lights a
pixel takes over what its neighbours on the same surface saw, and scales the sum by the share of it
that they say gets through; where too little is known, it sends rays of its own.

Cost   : about 0.1 µs per pixel and 64 lights, 0.2 µs where it mirrors.
"""

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.moving.neighbours import average_visible, compare, find_turns, load_packet, low
from render.moving.shadow_rays import CURVE, HALF, IRRADIANCE, LOOSE, MIRRORED, POINTS, SINE, SPREAD
from render.rays.embree import PACKET, occluded16, packet
from render.rays.first_hits import (
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
_SMALLEST_ALPHA2 = np.float32(4e-6)
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
            _gather(visible, row, x, y, first, key_count, side, is_soft, near_of, like, known, seen)
            for i in range(count):
                column = SIDE * (first - 1 + i) + x
                if part[KIND, i] == NOTHING:
                    continue
                is_glossy = part[KIND, i] == GLOSSY
                if is_glossy:
                    r, g, b, _, _, _, _, _, _ = _glossy(
                        part, i, eye, lights, rough_alpha2, 0, key_count, known, seen
                    )
                    rs, gs, bs, rk, gk, bk, rt, gt, bt = _glossy(
                        part,
                        i,
                        eye,
                        lights,
                        rough_alpha2,
                        key_count,
                        lights.shape[1],
                        known,
                        seen,
                    )
                else:
                    r, g, b, _, _, _, _, _, _ = _dull(part, i, lights, 0, key_count, known, seen)
                    rs, gs, bs, rk, gk, bk, rt, gt, bt = _dull(
                        part, i, lights, key_count, lights.shape[1], known, seen
                    )
                if rk + gk + bk < _LEAST_KNOWN * (rt + gt + bt):
                    _fill_in(
                        function, scene, sphere, offset_m, part, i, lights, points,
                        key_count, line + column, known, seen, rays, valid,
                    )  # fmt: skip
                    if is_glossy:
                        rs, gs, bs, rk, gk, bk, rt, gt, bt = _glossy(
                            part,
                            i,
                            eye,
                            lights,
                            rough_alpha2,
                            key_count,
                            lights.shape[1],
                            known,
                            seen,
                        )
                    else:
                        rs, gs, bs, rk, gk, bk, rt, gt, bt = _dull(
                            part, i, lights, key_count, lights.shape[1], known, seen
                        )
                picture[line, column, 0] += r + (rt * rs / rk if rk > 0 else np.float32(0))
                picture[line, column, 1] += g + (gt * gs / gk if gk > 0 else np.float32(0))
                picture[line, column, 2] += b + (bt * bs / bk if bk > 0 else np.float32(0))


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
                seen[i, slot] = average_visible(visible, row, x, y, first + i, slot, like, i)
    for turn in range(side * side):
        near = near_of[turn]
        qx, qy = x + near % SIDE + low(x), y + near // SIDE + low(y)
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


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
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


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _glossy(
    part: _FLOATS,
    i: int,
    eye: _FLOATS,
    lights: _FLOATS,
    rough_alpha2: np.float32,
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
    of = np.uint64(MIRRORED if alpha2 < rough_alpha2 else IRRADIANCE)
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
        red = lights[3, k] * (one - r) * mr * level
        red = shown * (red + lights[of, k] * r * mirrored)
        green = lights[4, k] * (one - g) * mg * level
        green = shown * (green + lights[of + _ONE, k] * g * mirrored)
        blue = lights[5, k] * (one - b) * mb * level
        blue = shown * (blue + lights[of + _TWO, k] * b * mirrored)
        rt, gt, bt = rt + red, gt + green, bt + blue
        rk, gk, bk = rk + known[i, k] * red, gk + known[i, k] * green, bk + known[i, k] * blue
        rs, gs, bs = rs + seen[i, k] * red, gs + seen[i, k] * green, bs + seen[i, k] * blue
    return rs, gs, bs, rk, gk, bk, rt, gt, bt
