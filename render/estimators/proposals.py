"""Directions drawn by the map's light or by what surfaces reflect, and what they carry.

Input  : surfaces, sixteen at a time, and points of the unit square.
Output : directions and radiance over density, in rows of `light` (shading.py).
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.estimators.contract import Floats, Shadows
from render.estimators.lobes import Array, draw_reflected, mirror_shares, reflected_density
from render.estimators.map_tables import MapTables, cell_of, draw_from_map
from render.estimators.points import Points, shifted, shifts_of
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible,
    add_waiting,
    reflect,
    waiting,
)
from render.rays.embree import PACKET
from render.reference.surfaces import HIT


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_proposed(
    shadows: Shadows,
    tables: MapTables,
    by_light: bool,
    has_lobe: bool,
    surfaces: Floats,
    points: Points,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    """Add an estimate of each surface from one direction for each point; return the rays traced."""
    traced = 0
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        held = waiting()
        light = np.zeros((FIELDS, PACKET), np.float32)
        shifts = shifts_of(seed, k, 0)
        shares = mirror_shares(surface) if has_lobe else np.zeros(PACKET)
        for s in range(len(points)):
            propose(tables, by_light, points, s, shifts, shares, surface, light)
            reflect(shadows, surface, light)
            traced += add_visible(shadows, surface, light, held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
    return traced


@njit(nogil=True, error_model="numpy", forceinline=True)
def propose(
    tables: MapTables,
    by_light: bool,
    points: Points,
    s: int,
    shifts: NDArray[np.uint64],
    shares: Array,
    surface: Floats,
    light: Floats,
) -> None:  # pragma: no cover - compiled
    """Set directions, and for what they carry radiance over density and number of points."""
    for i in range(PACKET):
        if surface[HIT, i] == 0 or (by_light and tables.rows[-1] == 0):
            set_carried(tables, 0, 0, 0.0, light, i)
            continue
        u, v = shifted(points, s, shifts[i])
        row, column, density = draw(tables, by_light, shares[i], surface, u, v, light, i)
        scale = 1 / (density * len(points)) if density > 0 else 0.0
        set_carried(tables, row, column, scale, light, i)


@njit(nogil=True, error_model="numpy", forceinline=True)
def draw(
    tables: MapTables,
    by_light: bool,
    share: float,
    surface: Floats,
    u: float,
    v: float,
    light: Floats,
    i: int,
) -> tuple[int, int, float]:  # pragma: no cover - compiled
    """Set direction `i`; return row and column of its cell of the map, and its density per sr."""
    if by_light:
        row, column, x, y, z = draw_from_map(tables, u, v)
        density = float(tables.density[row, column])
    else:
        x, y, z = draw_reflected(surface, i, share, u, v)
        row, column = cell_of(tables, x, y, z)
        density = reflected_density(surface, i, share, x, y, z)
    light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i] = x, y, z
    return row, column, density


@njit(nogil=True, forceinline=True)
def set_carried(
    tables: MapTables, row: int, column: int, scale: float, light: Floats, i: int
) -> None:  # pragma: no cover - compiled
    """Let direction `i` carry the radiance of a cell times `scale`."""
    for c in range(3):
        light[CARRIED + c, i] = scale * tables.radiance[row, column, c]
