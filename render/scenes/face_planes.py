"""Planes of a mesh's triangles, in compiled loops, and how far places are from them."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.scenes.vertex_faces import GONE, Indices

Floats = NDArray[np.float64]


@njit(nogil=True)
def planes_of(positions: Floats, faces: Indices) -> Floats:  # pragma: no cover - compiled
    """Return each face's plane (F, 4), 0 on it; zeros for a face without area."""
    planes = np.empty((len(faces), 4))
    for face in range(len(faces)):
        set_plane(planes, positions, faces, face)
    return planes


@njit(nogil=True)
def set_plane(
    planes: Floats, positions: Floats, faces: Indices, face: int
) -> None:  # pragma: no cover - compiled
    """Set a face's plane anew; zeros if it has no area."""
    a, b, c = faces[face]
    x, y, z = area_normal(positions[a], positions[b], positions[c])
    area = math.sqrt(x * x + y * y + z * z)
    scale = 1 / area if area > 0 else 0.0
    planes[face, 0], planes[face, 1], planes[face, 2] = scale * x, scale * y, scale * z
    planes[face, 3] = -scale * (x * positions[a, 0] + y * positions[a, 1] + z * positions[a, 2])


@njit(nogil=True)
def area_normal(
    a: Floats, b: Floats, c: Floats
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a triangle's normal, twice as long as its area is large."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    u, v, w = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return y * w - z * v, z * u - x * w, x * v - y * u


@njit(nogil=True)
def off_planes(
    planes: Floats,
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    vertex: int,
    place: Floats,
    enough: float,
) -> float:  # pragma: no cover - compiled
    """Return how far at most a place is from the planes around a vertex, or more than enough."""
    off = 0.0
    for face in of_vertex[starts[vertex] : starts[vertex + 1]]:
        if faces[face, 0] != GONE:
            x, y, z, w = planes[face]
            off = max(off, abs(x * place[0] + y * place[1] + z * place[2] + w))
            if off >= enough:
                break
    return off
