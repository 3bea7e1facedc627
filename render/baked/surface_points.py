"""Points all over a scene that light is worked out for; between_points.py interpolates it.

A triangle has one at each corner, and a large one a grid of them. The ground has square grids, each
around the one before and twice as wide; beyond the last nothing is shaded.

Input  : a scene.    Output : points with normals.
Fails  : light is blurred by the distance between points, 1/24 of the scene's radius. Both sides of
         an open surface get the light of the side that its normals look to.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.scenes.scene import Ground
from render.scenes.triangle_tables import Geometry

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]

_SPACING = 1 / 24  # of the scene's radius
_MOST_STEPS = 64
_GRID_STEPS = 96

GRIDS = 4
"""Of the ground, if there is one, each twice as wide as the one before."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of a scene.

    Attributes
    ----------
    positions, normals : (P, 3) float32
        Those of the ground last.
    corners : (F, 3) int32
        A triangle's points, or only the first of a grid's.
    steps : (F,) int32
        Into how many parts each side of a triangle is cut.
    grids : (5,) float32
        Of the ground: x and z of their middle, half the width of the smallest, how many there are
        (0 without a ground), and into how many parts their sides are cut.
    ground_start : int
        The first point of the ground.
    """

    positions: _FLOATS
    normals: _FLOATS
    corners: NDArray[np.int32]
    steps: NDArray[np.int32]
    grids: _FLOATS
    ground_start: int


def surface_points(geometry: Geometry, ground: Ground | None) -> SurfacePoints:
    """Return the points of a scene's triangles and ground."""
    spacing_m = max(_SPACING * geometry.radius_m, 1e-9)
    corners = geometry.positions[geometry.faces]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    steps = np.clip(np.ceil(sides.max(axis=1, initial=0) / spacing_m), 1, _MOST_STEPS)
    steps = steps.astype(np.int32)
    first = geometry.faces.copy()
    positions: list[Any] = [geometry.positions]
    normals: list[Any] = [geometry.attributes[:, :3]]
    count = len(geometry.positions)
    for face in np.flatnonzero(steps > 1):
        shares = _triangle_grid(int(steps[face]))
        positions.append(shares @ corners[face])
        normals.append(shares @ geometry.attributes[geometry.faces[face], :3])
        first[face] = count
        count += len(shares)
    grids = np.zeros(5, np.float32)
    if ground is not None:
        half_m = geometry.radius_m or ground.radius_m
        grids[:] = geometry.centre[0], geometry.centre[2], half_m, GRIDS, _GRID_STEPS
        level = _ground_points(grids, ground.y_m)
        positions.append(level)
        normals.append(np.tile(np.array([0, 1, 0], np.float32), (len(level), 1)))
    unit = np.concatenate(normals).astype(np.float32)
    unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-12)
    return SurfacePoints(
        np.concatenate(positions).astype(np.float32), unit, first, steps, grids, count
    )


def _triangle_grid(steps: int) -> Array:
    """Return the corners' shares (n, 3) at the points of a grid: rows of equal u, v rising."""
    u, v = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
    inside = u + v <= steps
    across, along = u[inside] / steps, v[inside] / steps
    return np.stack([1 - across - along, across, along], axis=-1)


def _ground_points(grids: _FLOATS, y_m: float) -> Array:
    """Return the points of all grids, (n, 3): one grid after another, rows of equal x."""
    across = np.linspace(-1, 1, _GRID_STEPS + 1)
    x, z = np.meshgrid(across, across, indexing="ij")
    one = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    middle = np.array([grids[0], y_m, grids[1]])
    return np.concatenate([middle + 2**k * float(grids[2]) * one for k in range(GRIDS)])
