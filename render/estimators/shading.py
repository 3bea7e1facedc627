"""What every estimator does with the directions it has drawn: reflect their light, look for shadow.

Directions come sixteen at a time, one for each surface of a packet, as rows of an array `light`
(FIELDS, 16) float32: `TOWARD` (3), and `CARRIED` (3), red, green and blue: radiance over density
and number of samples, for instance. Where that is 0 nothing is computed or traced.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.estimators.contract import Shadows
from render.rays.embree import PACKET, coherent16, occluded16, packet
from render.reference.surfaces import (
    ALPHA2,
    F0,
    F90,
    FACE_NORMAL,
    FAR_M,
    HIT,
    MATT,
    NORMAL,
    ORIGIN,
    TO_EYE,
)

Floats = NDArray[np.float32]

TOWARD, CARRIED = 0, 3
FIELDS = 6
"""Rows of `light`."""


class Waiting(NamedTuple):
    """Rays of one packet of surfaces that are yet to be traced, from any of its samples.

    Sixteen that are all needed take Embree half as long as those of two samples of which half are.

    Attributes
    ----------
    rays, valid : (12, 16) float32, (16,) int32
        Of `embree.packet`.
    carried : (3, 16) float32
    column : (17,) int64
        Which surface each begins at; how many there are.
    is_unknown : (16,) int32
        Scratch.
    """

    rays: Floats
    valid: NDArray[np.int32]
    carried: Floats
    column: NDArray[np.int64]
    is_unknown: NDArray[np.int32]


_RED, _GREEN, _BLUE = LUMINANCE_WEIGHTS.astype(np.float32)
_0, _1, _HALF, _PI = np.float32(0), np.float32(1), np.float32(0.5), np.float32(math.pi)


# Inlined, or a run that compiles rounds otherwise than those that load what it compiled.
@njit(nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def reflect(shadows: Shadows, surface: Floats, light: Floats) -> None:  # pragma: no cover
    """Multiply what directions carry by f n·l, 0 from below a surface, its face or the ground."""
    lowest = np.float32(shadows.lowest)
    # Flat: rows at constant distances, which lets the compiler see that none overlap.
    at, to = surface.flat, light.flat
    for i in range(PACKET):
        x, y, z = (
            to[PACKET * TOWARD + i],
            to[PACKET * (TOWARD + 1) + i],
            to[PACKET * (TOWARD + 2) + i],
        )
        nx, ny, nz = (
            at[PACKET * NORMAL + i],
            at[PACKET * (NORMAL + 1) + i],
            at[PACKET * (NORMAL + 2) + i],
        )
        ex, ey, ez = (
            at[PACKET * TO_EYE + i],
            at[PACKET * (TO_EYE + 1) + i],
            at[PACKET * (TO_EYE + 2) + i],
        )
        n_l = x * nx + y * ny + z * nz
        facing = (
            at[PACKET * FACE_NORMAL + i] * x
            + at[PACKET * (FACE_NORMAL + 1) + i] * y
            + at[PACKET * (FACE_NORMAL + 2) + i] * z
        )
        is_lit = (at[PACKET * HIT + i] > _0) & (n_l > _0) & (facing > _0) & (y > lowest)
        n_l = n_l if is_lit else _0
        # As reference/reflection.py has it, in float32, for sixteen at once.
        alpha2 = at[PACKET * ALPHA2 + i]
        hx, hy, hz = ex + x, ey + y, ez + z
        scale = _1 / np.sqrt(max(hx * hx + hy * hy + hz * hz, np.float32(1e-12)))
        hx, hy, hz = scale * hx, scale * hy, scale * hz
        n_v = ex * nx + ey * ny + ez * nz
        n_h = nx * hx + ny * hy + nz * hz
        cx, cy, cz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
        spread = cx * cx + cy * cy + cz * cz + alpha2 * n_h * n_h
        seen = np.sqrt(n_v * n_v * (_1 - alpha2) + alpha2)
        lit = np.sqrt(n_l * n_l * (_1 - alpha2) + alpha2)
        mirror = _HALF * alpha2 * n_l / (_PI * spread * spread * (n_l * seen + n_v * lit))
        c = _1 - min(ex * hx + ey * hy + ez * hz, _1)
        grazing = c * c * c * c * c
        for k in range(3):
            f0 = at[PACKET * (F0 + k) + i]
            fresnel = f0 + (at[PACKET * F90 + i] - f0) * grazing
            passed = (_1 - fresnel) * at[PACKET * (MATT + k) + i] * n_l + fresnel * mirror
            to[PACKET * (CARRIED + k) + i] = (
                to[PACKET * (CARRIED + k) + i] * passed if is_lit else _0
            )


@njit(nogil=True, forceinline=True)
def waiting() -> Waiting:  # pragma: no cover - compiled
    """Return room for the rays of a packet of surfaces, with none in it."""
    rays, valid = packet()
    carried = np.zeros((3, PACKET), np.float32)
    return Waiting(rays, valid, carried, np.zeros(PACKET + 1, np.int64), np.zeros_like(valid))


@njit(nogil=True, forceinline=True)
def add_visible(
    shadows: Shadows, surface: Floats, light: Floats, held: Waiting, total: Floats
) -> int:  # pragma: no cover - compiled
    """Add what directions carry in which nothing stands to `total`; return the rays traced.

    Rays that have to be traced wait until there are sixteen: `add_waiting` takes the last.
    """
    rays, carried, column, is_unknown = held.rays, held.carried, held.column, held.is_unknown
    _find_unknown(shadows.sphere, surface, light, is_unknown)
    _add_known(light, is_unknown, total)
    count, traced = column[PACKET], 0
    for i in range(PACKET):
        if is_unknown[i] == 0:
            continue
        for axis in range(3):
            rays[axis, count] = surface[ORIGIN + axis, i]
            rays[4 + axis, count] = light[TOWARD + axis, i]
            carried[axis, count] = light[CARRIED + axis, i]
        column[count] = i
        count += 1
        if count == PACKET:
            column[PACKET] = count
            traced += add_waiting(shadows, held, total)
            count = 0
    column[PACKET] = count
    return traced


@njit(nogil=True, forceinline=True)
def add_waiting(shadows: Shadows, held: Waiting, total: Floats) -> int:  # pragma: no cover
    """Trace the rays that wait, add what the free ones carry to `total`; return their number."""
    count = held.column[PACKET]
    if count == 0:
        return 0
    for j in range(PACKET):
        held.valid[j] = -np.int32(j < count)
        held.rays[8, j] = FAR_M
    rays = held.rays.ctypes.data
    occluded16(shadows.function, held.valid.ctypes.data, shadows.scene, rays)  # type: ignore[call-arg]
    for j in range(count):
        if held.rays[8, j] > _0:
            for c in range(3):
                total[c, held.column[j]] += held.carried[c, j]
    held.column[PACKET] = 0
    return int(count)


@njit(nogil=True, forceinline=True)
def add_visible_alike(
    shadows: Shadows, surface: Floats, light: Floats, shadow: tuple[Any, Any], total: Floats
) -> int:  # pragma: no cover - compiled
    """Do what `add_visible` does for directions that are all the same: none has to wait.

    `shadow` is memory of `embree.packet`, whose origins `start_at` has set.
    """
    rays, valid = shadow
    _find_unknown(shadows.sphere, surface, light, valid)
    _add_known(light, valid, total)
    needed = np.int32(0)
    for i in range(PACKET):
        needed += valid[i]
    if needed == 0:
        return 0
    for i in range(PACKET):
        valid[i] = -valid[i]
        rays[8, i] = FAR_M
    for axis in range(3):
        for i in range(PACKET):
            rays[4 + axis, i] = light[TOWARD + axis, i]
    coherent16(shadows.function, valid.ctypes.data, shadows.scene, rays.ctypes.data)  # type: ignore[call-arg]
    for i in range(PACKET):
        valid[i] = np.int32((valid[i] == 0) | (rays[8, i] < _0))
    _add_known(light, valid, total)
    return int(needed)


@njit(nogil=True, forceinline=True)
def start_at(surface: Floats, shadow: tuple[Any, Any]) -> None:  # pragma: no cover - compiled
    """Let rays begin at the surfaces of a packet."""
    shadow[0][0:3] = surface[ORIGIN : ORIGIN + 3]


@njit(nogil=True, fastmath={"contract"}, forceinline=True)
def _find_unknown(
    sphere: Floats, surface: Floats, light: Floats, is_unknown: NDArray[np.int32]
) -> None:  # pragma: no cover - compiled
    """Set which directions carry light that something may stand in the way of."""
    at, to = surface.flat, light.flat  # as in `reflect`
    centre_x, centre_y, centre_z, radius = sphere[0], sphere[1], sphere[2], sphere[3]
    for i in range(PACKET):
        x, y, z = (
            to[PACKET * TOWARD + i],
            to[PACKET * (TOWARD + 1) + i],
            to[PACKET * (TOWARD + 2) + i],
        )
        dx, dy, dz = (
            centre_x - at[PACKET * ORIGIN + i],
            centre_y - at[PACKET * (ORIGIN + 1) + i],
            centre_z - at[PACKET * (ORIGIN + 2) + i],
        )
        along = dx * x + dy * y + dz * z
        off2 = dx * dx + dy * dy + dz * dz - along * along
        carried = (
            to[PACKET * CARRIED + i]
            + to[PACKET * (CARRIED + 1) + i]
            + to[PACKET * (CARRIED + 2) + i]
        )
        is_unknown[i] = np.int32((carried > _0) & (off2 < radius * radius) & (along > -radius))


@njit(nogil=True, forceinline=True)
def _add_known(
    light: Floats, is_unknown: NDArray[np.int32], total: Floats
) -> None:  # pragma: no cover - compiled
    """Add what directions carry to `total`, but for those that are marked."""
    carried, out = light.flat, total.flat
    for c in range(3):
        for i in range(PACKET):
            free = carried[PACKET * (CARRIED + c) + i]
            out[PACKET * c + i] += _0 if is_unknown[i] != 0 else free


@njit(nogil=True, forceinline=True)
def luminance_of(light: Floats, i: int) -> np.float32:  # pragma: no cover - compiled
    """Return the luminance of what direction `i` carries."""
    red, green, blue = light[CARRIED, i], light[CARRIED + 1, i], light[CARRIED + 2, i]
    return _RED * red + _GREEN * green + _BLUE * blue


@njit(nogil=True, forceinline=True)
def cell_luminance(radiance: Floats, row: int, column: int) -> float:  # pragma: no cover - compiled
    """Return the luminance of a cell of a map."""
    red, green, blue = radiance[row, column]
    return np.float64(_RED * red + _GREEN * green + _BLUE * blue)
