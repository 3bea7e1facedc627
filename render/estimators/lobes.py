"""Directions as a surface reflects: by its cosine, and by its mirror's visible normals.

Their density is (1 − q) n·l/π + q p, with the density p of GGX's visible normals
(reference/reflection.py) and q about the share that the mirror has in what the surface reflects.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.rays.embree import PACKET
from render.rays.tangent_frame import tangent_frame
from render.reference.angles import sine_cosine
from render.reference.reflection import drawn, reflected
from render.reference.surfaces import F0, F90, MATT, NORMAL, TO_EYE

Floats = NDArray[np.float32]
Array = NDArray[np.float64]


@njit(nogil=True, forceinline=True)
def mirror_shares(surface: Floats) -> Array:  # pragma: no cover - compiled
    """Return `mirror_share` of each surface of a packet, (16,)."""
    shares = np.empty(PACKET)
    for i in range(PACKET):
        shares[i] = mirror_share(surface, i)
    return shares


@njit(nogil=True, forceinline=True)
def mirror_share(surface: Floats, i: int) -> float:  # pragma: no cover - compiled
    """Return how much of the directions of a surface its mirror should draw."""
    if surface[F90, i] == 0:
        return 0.0
    n_v = 0.0
    for axis in range(3):
        n_v += surface[NORMAL + axis, i] * surface[TO_EYE + axis, i]
    grazing = (1 - min(n_v, 1.0)) ** 5
    mirror = matt = 0.0
    for c in range(3):
        fresnel = surface[F0 + c, i] + (surface[F90, i] - surface[F0 + c, i]) * grazing
        mirror += fresnel
        matt += (1 - fresnel) * surface[MATT + c, i] * math.pi
    return mirror / (mirror + matt) if mirror > 0 else 0.0


@njit(nogil=True, forceinline=True)
def draw_reflected(
    surface: Floats, i: int, share: float, u: float, v: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a direction of density `reflected_density`, for (u, v) even in [0, 1)².

    It may lie below the surface.
    """
    if u < share:
        return drawn(surface, i, u / share, v)
    u = (u - share) / (1 - share)
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    sine, cosine = sine_cosine(v)
    level = math.sqrt(u)
    x, y, up = level * cosine, level * sine, math.sqrt(1 - u)
    return x * tx + y * bx + up * nx, x * ty + y * by + up * ny, x * tz + y * bz + up * nz


@njit(nogil=True, forceinline=True)
def reflected_density(
    surface: Floats, i: int, share: float, x: float, y: float, z: float
) -> float:  # pragma: no cover - compiled
    """Return the density of `draw_reflected` at (x, y, z), per sr; 0 below the surface."""
    n_l = surface[NORMAL, i] * x + surface[NORMAL + 1, i] * y + surface[NORMAL + 2, i] * z
    if n_l <= 0:
        return 0.0
    density = (1 - share) * n_l / math.pi
    if share > 0:
        density += share * reflected(surface, i, x, y, z)[2]
    return density
