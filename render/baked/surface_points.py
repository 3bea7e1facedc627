"""Points all over a scene that light is worked out for, and its interpolation between them.

A triangle has one at each corner, and a large one a grid of them. The ground has square grids, each
around the one before and twice as wide; beyond the last nothing is shaded.

Input  : a scene.    Output : points with normals; light at any place of any triangle.
Cost   : a look-up, about 20 ns a pixel.
Fails  : light is blurred by the distance between points, 1/24 of the scene's radius. Both sides of
         an open surface get the light of the side that its normals look to.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.row_order import row_order
from render.rays.surface_rows import (
    F0,
    F90,
    GROUND,
    KIND,
    MATT,
    NOTHING,
    POSITION,
    SIDE,
    TRIANGLE,
    U,
    V,
)
from render.scenes.scene import Ground
from render.scenes.triangle_tables import Geometry

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]

_SPACING = 1 / 24  # of the scene's radius
_MOST_STEPS = 64
_GRIDS = 4
_GRID_STEPS = 96
_HEMISPHERE_FRESNEL = np.float32(1 / 21)  # mean of (1 − n·l)⁵ over a Lambertian surface's light


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
        grids[:] = geometry.centre[0], geometry.centre[2], half_m, _GRIDS, _GRID_STEPS
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
    return np.concatenate([middle + 2**k * float(grids[2]) * one for k in range(_GRIDS)])


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def add_irradiance(
    surfaces: _FLOATS,
    corners: NDArray[np.int32],
    steps: NDArray[np.int32],
    grids: _FLOATS,
    ground_start: int,
    irradiance: _FLOATS,
    unshaded: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add to `picture` (H, W, 4) what surfaces reflect evenly of the irradiance at points (P, 3).

    Parameters
    ----------
    surfaces : (rows, LANES, FIELDS + 3, columns) float32
        As `first_hits` finds them, with triangles.
    corners, steps, grids, ground_start
        Of `SurfacePoints`.
    unshaded : (3,) float32
        Irradiance of the ground beyond the grids.
    """
    order = row_order(0, picture.shape[0])
    for k in prange(len(order)):
        line = order[k]
        row, light = 1 + line // SIDE, np.empty(3, np.float32)
        for x in range(SIDE):  # along a lane, whose pixels lie side by side
            seen = surfaces[row, SIDE * (line % SIDE) + x]
            triangles = seen[TRIANGLE].view(np.int32)
            for at in range(1, seen.shape[1] - 1):
                column, kind = SIDE * (at - 1) + x, seen[KIND, at]
                if kind == NOTHING or column >= picture.shape[1]:
                    continue
                if kind == GROUND:
                    x_m, z_m = seen[POSITION, at], seen[POSITION + 2, at]
                    _on_ground(x_m, z_m, grids, ground_start, irradiance, unshaded, light)
                else:
                    face = triangles[at]
                    _on_triangle(
                        corners[face], steps[face], seen[U, at], seen[V, at], irradiance, light
                    )
                for c in range(3):
                    f0 = seen[F0 + c, at]
                    mirrored = f0 + (seen[F90, at] - f0) * _HEMISPHERE_FRESNEL
                    picture[line, column, c] += seen[MATT + c, at] * light[c] * (1 - mirrored)


@njit(nogil=True, error_model="numpy")
def _on_triangle(
    corners: NDArray[np.int32],
    steps: int,
    u: np.float32,
    v: np.float32,
    irradiance: _FLOATS,
    light: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `light` to the mean over the three points around a place of a triangle."""
    a, b, c = corners[0], corners[1], corners[2]
    if steps > 1:
        u, v = u * steps, v * steps
        i = min(int(u), steps - 1)
        j = min(int(v), steps - 1 - i)
        u, v = u - i, v - j
        a = corners[0] + i * (steps + 1) - i * (i - 1) // 2 + j
        b, c = a + steps + 1 - i, a + 1  # the rows below have one point fewer each
        if u + v > 1 and i + j < steps - 1:
            a, u, v = b + 1, 1 - v, 1 - u
    for channel in range(3):
        light[channel] = (
            (1 - u - v) * irradiance[a, channel]
            + u * irradiance[b, channel]
            + v * irradiance[c, channel]
        )


@njit(nogil=True, error_model="numpy")
def _on_ground(
    x_m: np.float32,
    z_m: np.float32,
    grids: _FLOATS,
    start: int,
    irradiance: _FLOATS,
    unshaded: _FLOATS,
    light: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `light` to the mean over the four points around a place of the ground."""
    x, z = x_m - grids[0], z_m - grids[1]
    half_m, most = grids[2], max(abs(x), abs(z))
    grid = 0
    while grid < grids[3] and most >= half_m:
        grid, half_m = grid + 1, 2 * half_m
    if grid >= grids[3]:
        light[:] = unshaded
        return
    steps = int(grids[4])
    side, half = steps + 1, np.float32(0.5) * grids[4]
    across, along = (x / half_m + 1) * half, (z / half_m + 1) * half
    i, j = min(int(across), steps - 1), min(int(along), steps - 1)
    u, v = np.float32(across - i), np.float32(along - j)
    a = start + (grid * side + i) * side + j
    for c in range(3):
        before = (1 - v) * irradiance[a, c] + v * irradiance[a + 1, c]
        after = (1 - v) * irradiance[a + side, c] + v * irradiance[a + side + 1, c]
        light[c] = (1 - u) * before + u * after
