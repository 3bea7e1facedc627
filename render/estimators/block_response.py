"""What surfaces reflect of each block of the map: about f n·l, positive wherever that is.

The luminance of f n·l at the middle of a block, as a surface reflects that is rougher by the
block's extent, and whose horizon is as soft. Only a guide to where directions are drawn.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.rays.embree import PACKET
from render.reference.surfaces import ALPHA2, F0, F90, HIT, MATT, NORMAL, TO_EYE

Floats = NDArray[np.float32]

_RED, _GREEN, _BLUE = LUMINANCE_WEIGHTS.astype(np.float32)
_0, _1, _HALF, _PI = np.float32(0), np.float32(1), np.float32(0.5), np.float32(math.pi)


# Inlined, or a run that compiles rounds otherwise than those that load what it compiled.
@njit(nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def respond(
    surface: Floats, x: np.float32, y: np.float32, z: np.float32, radius: np.float32, out: Floats
) -> None:  # pragma: no cover - compiled
    """Set `out` (16,) for a block around (x, y, z), for each surface of a packet; 0 for no hit."""
    at = surface.flat  # rows at constant distances: sixteen at once
    for i in range(PACKET):
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
        soft = max(n_l + radius, _0)
        n_l = soft * soft / (np.float32(4) * radius) if n_l < radius else n_l
        widened = min(at[PACKET * ALPHA2 + i] + np.float32(0.25) * radius * radius, _1)
        hx, hy, hz = ex + x, ey + y, ez + z
        scale = _1 / np.sqrt(max(hx * hx + hy * hy + hz * hz, np.float32(1e-12)))
        n_v = ex * nx + ey * ny + ez * nz
        n_h = scale * (nx * hx + ny * hy + nz * hz)
        spread = _1 + (widened - _1) * n_h * n_h
        seen = np.sqrt(n_v * n_v * (_1 - widened) + widened)
        lit = np.sqrt(n_l * n_l * (_1 - widened) + widened)
        mirror = _HALF * widened * n_l / (_PI * spread * spread * (n_l * seen + n_v * lit))
        c = _1 - min(scale * (ex * hx + ey * hy + ez * hz), _1)
        grazing = c * c * c * c * c
        f0 = (
            _RED * at[PACKET * F0 + i]
            + _GREEN * at[PACKET * (F0 + 1) + i]
            + _BLUE * at[PACKET * (F0 + 2) + i]
        )
        matt = (
            _RED * at[PACKET * MATT + i]
            + _GREEN * at[PACKET * (MATT + 1) + i]
            + _BLUE * at[PACKET * (MATT + 2) + i]
        )
        fresnel = f0 + (at[PACKET * F90 + i] - f0) * grazing
        value = (_1 - fresnel) * matt * n_l + fresnel * mirror
        out[i] = value if at[PACKET * HIT + i] > _0 else _0
