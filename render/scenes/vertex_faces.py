"""Triangles about each vertex of a mesh that loses some of them.

Input  : faces (F, 3), vertex indices; one that is gone begins with `GONE`.
Output : the faces of each vertex as a list (`of_vertex`) and where each vertex' part of it begins
(`starts`), and what can be told from these.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Indices = NDArray[np.int32]
Flags = NDArray[np.bool_]

GONE = -1


@njit(cache=True, nogil=True)
def faces_of_vertices(
    faces: Indices, vertices: int
) -> tuple[Indices, Indices]:  # pragma: no cover - compiled
    """Return where each vertex' faces begin in a list of them, (V + 1,), and that list."""
    starts = np.zeros(vertices + 1, np.int32)
    for face in range(len(faces)):
        for k in range(3):
            starts[faces[face, k] + 1] += 1
    for vertex in range(vertices):
        starts[vertex + 1] += starts[vertex]
    of_vertex = np.empty(3 * len(faces), np.int32)
    place = starts.copy()
    for face in range(len(faces)):
        for k in range(3):
            of_vertex[place[faces[face, k]]] = face
            place[faces[face, k]] += 1
    return starts, of_vertex


@njit(cache=True, nogil=True)
def rim(
    faces: Indices, starts: Indices, of_vertex: Indices
) -> Flags:  # pragma: no cover - compiled
    """Return which vertices are on edges of a single triangle."""
    is_rim = np.zeros(len(starts) - 1, np.bool_)
    for face in range(len(faces)):
        for k in range(3):
            a, b = faces[face, k], faces[face, (k + 1) % 3]
            if shared_count(faces, starts, of_vertex, a, b) == 1:
                is_rim[a] = is_rim[b] = True
    return is_rim


@njit(nogil=True)
def shared_count(
    faces: Indices, starts: Indices, of_vertex: Indices, a: int, b: int
) -> int:  # pragma: no cover - compiled
    """Return how many triangles have both vertices."""
    count = 0
    for face in of_vertex[starts[a] : starts[a + 1]]:
        count += faces[face, 0] != GONE and has(faces, face, b)
    return count


@njit(nogil=True)
def valence(
    faces: Indices, starts: Indices, of_vertex: Indices, vertex: int
) -> int:  # pragma: no cover - compiled
    """Return how many triangles a vertex has."""
    count = 0
    for face in of_vertex[starts[vertex] : starts[vertex + 1]]:
        count += faces[face, 0] != GONE
    return count


@njit(nogil=True)
def has(faces: Indices, face: int, vertex: int) -> bool:  # pragma: no cover - compiled
    """Whether a face has a vertex."""
    return bool(faces[face, 0] == vertex or faces[face, 1] == vertex or faces[face, 2] == vertex)
