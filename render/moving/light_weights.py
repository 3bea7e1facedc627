"""What each of a table of lights gives a pixel without shadow, and sums of it.

A light gives what shade.frag has it give. Where normals do not change from pixel to pixel, as on
the ground, neither does what Lambertian surfaces receive.

Input  : surfaces of a packet, a table of lights as in shadow_rays.
Output : weights (3, K), of red, green and blue.
Cost   : about 0.7 ns a light, 2 ns where it mirrors; a sum, 0.2 ns.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.moving.shadow_rays import CURVE, HALF, IRRADIANCE, MIRRORED, SINE, SPREAD
from render.rays.surface_rows import ALPHA2, F0, F90, FACE_NORMAL, MATT, NORMAL

_FLOATS = NDArray[np.float32]
_ONE, _TWO = np.uint64(1), np.uint64(2)
_HALF_BY_PI = np.float32(0.5 / math.pi)
_SMALLEST_ALPHA2 = np.float32(4e-6)


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def weigh_dull(
    part: _FLOATS, i: int, lights: _FLOATS, weights: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set `weights` to the irradiance of Lambertian pixel `i`."""
    zero, one = np.float32(0), np.float32(1)
    nx, ny, nz = part[NORMAL, i], part[NORMAL + 1, i], part[NORMAL + 2, i]
    fx, fy, fz = part[FACE_NORMAL, i], part[FACE_NORMAL + 1, i], part[FACE_NORMAL + 2, i]
    for k in range(np.uint64(0), np.uint64(lights.shape[1])):
        lx, ly, lz = lights[0, k], lights[1, k], lights[2, k]
        cosine = nx * lx + ny * ly + nz * lz
        facing = fx * lx + fy * ly + fz * lz
        sine = lights[SINE, k]
        t = max(one + cosine * cosine * lights[CURVE, k], zero)
        even = sine - t * (lights[CURVE + 1, k] + t * lights[CURVE + 2, k])
        level = lights[HALF, k] * (cosine + max(abs(cosine), even))
        level = level if facing > -sine else zero
        weights[0, k] = level * lights[3, k]
        weights[1, k] = level * lights[4, k]
        weights[2, k] = level * lights[5, k]


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def weigh_glossy(
    part: _FLOATS,
    i: int,
    eye: _FLOATS,
    lights: _FLOATS,
    rough_alpha2: np.float32,
    weights: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `weights` to the radiance of pixel `i`, which mirrors too.

    It mirrors all of a light if it is as rough as `rough_alpha2`, else what `MIRRORED` says.
    """
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
    for k in range(np.uint64(0), np.uint64(lights.shape[1])):
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
        red = lights[3, k] * (one - r) * mr * level + lights[of, k] * r * mirrored
        green = lights[4, k] * (one - g) * mg * level + lights[of + _ONE, k] * g * mirrored
        blue = lights[5, k] * (one - b) * mb * level + lights[of + _TWO, k] * b * mirrored
        weights[0, k], weights[1, k], weights[2, k] = shown * red, shown * green, shown * blue


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def weighed_sum(
    weights: _FLOATS, start: int, shares: NDArray[Any]
) -> tuple[Any, ...]:  # pragma: no cover - compiled
    """Return Σ weight × share (3,) of the lights from `start` on that there are shares of."""
    r = g = b = np.float32(0)
    light = np.uint64(start)
    for k in range(np.uint64(len(shares))):
        share = np.float32(shares[k])
        r += share * weights[0, light + k]
        g += share * weights[1, light + k]
        b += share * weights[2, light + k]
    return r, g, b
