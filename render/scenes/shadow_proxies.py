"""Casters of fewer triangles, whose shadows a map of depth cannot tell from those of all.

Edges are collapsed, those that change little first. A vertex knows how far off the surface about it
may be already; to this a collapse adds the distance of where it puts the vertex from the planes of
the triangles that it replaces, and from the lines of their rim. A new triangle shares an edge with
the one it replaces, so it is nowhere farther from it than at that vertex.

Input  : Casters, an error.    Output : Casters.
Cost   : once per scene, on one core: 5 µs per triangle of a million, 7 µs of 80,000.
Fails  : distances are from planes: beyond a triangle's edge its surface may be farther. A needle
         thinner than the error may become shorter. Meshes with edges of three triangles stay as
         they are there, and what is smaller than the error stays as a few triangles.
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit

from render.scenes.casters import Casters
from render.scenes.face_planes import Floats, area_normal, off_planes, planes_of, set_plane
from render.scenes.vertex_faces import (
    GONE,
    Flags,
    Indices,
    faces_of_vertices,
    has,
    rim,
    shared_count,
    valence,
)

_SHARES = (1 / 8, 1)  # of the error: what changes little goes first
_WORTH_A_PASS = 0.1  # of the triangles
_ALIKE = 0.2  # cosine between a triangle's normals before and after


def shadow_proxy(casters: Casters, error_m: float) -> Casters:
    """Return casters of fewer triangles that are off by `error_m` at most.

    Closed meshes stay closed. Centre and radius remain those of what they stand for, beyond which
    they may reach by the error.

    Parameters
    ----------
    casters : Casters
        If they are proxies themselves, their own error counts as well.
    error_m : float
        From the surface, in m.
    """
    faces = np.concatenate([casters.closed_faces, casters.open_faces])
    if error_m <= casters.error_m or len(faces) == 0:
        return casters
    is_open = np.arange(len(faces)) >= len(casters.closed_faces)
    positions = casters.positions.astype(np.float64)
    off_m = np.full(len(positions), casters.error_m)
    starts, of_vertex = faces_of_vertices(faces, len(positions))
    is_rim = rim(faces, starts, of_vertex)
    for share in _SHARES:
        before = math.inf
        while len(faces) < (1 - _WORTH_A_PASS) * before:
            before = len(faces)
            _collapse_edges(positions, off_m, is_rim, faces, starts, of_vertex, share * error_m)
            is_left = faces[:, 0] != GONE
            faces, is_open = faces[is_left], is_open[is_left]
            starts, of_vertex = faces_of_vertices(faces, len(positions))
    used, index = np.unique(faces, return_inverse=True)
    faces = index.reshape(-1, 3).astype(np.int32)
    return replace(
        casters,
        positions=positions[used].astype(np.float32),
        closed_faces=faces[~is_open],
        open_faces=faces[is_open],
        error_m=error_m,
    )


@njit(cache=True, nogil=True)
def _collapse_edges(
    positions: Floats,
    off_m: Floats,
    is_rim: Flags,
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    most_m: float,
) -> None:  # pragma: no cover - compiled
    """Merge the ends of edges where that leaves all within `most_m`, each vertex once.

    What is merged takes the place of the first of the two; faces that vanish are marked.
    """
    is_merged = np.zeros(len(positions), np.bool_)  # its list of faces is not up to date
    seen_from = np.full(len(positions), -1, np.int32)
    planes = planes_of(positions, faces)
    place, best = np.empty(3), np.empty(3)
    for face in range(len(faces)):
        for side in range(3):
            if faces[face, 0] == GONE:
                break
            a, b = faces[face, side], faces[face, (side + 1) % 3]
            if is_merged[a] or is_merged[b]:
                continue
            least_m = most_m - max(off_m[a], off_m[b])
            is_better = False
            for share in (0.0, 1.0, 0.5):  # of the way from a to b
                if (is_rim[a] and not is_rim[b] and share != 0) or (
                    is_rim[b] and not is_rim[a] and share != 1
                ):
                    continue  # a rim stays where it is
                for k in range(3):
                    place[k] = (1 - share) * positions[a, k] + share * positions[b, k]
                if share == 0.5 and not is_rim[a]:
                    _centre(planes, faces, starts, of_vertex, a, b, place)
                off = max(
                    off_planes(planes, faces, starts, of_vertex, a, place, least_m),
                    off_planes(planes, faces, starts, of_vertex, b, place, least_m),
                )
                if is_rim[a] and is_rim[b]:
                    for end in (a, b):
                        off = max(
                            off, _off_rim(positions, faces, starts, of_vertex, is_rim, end, place)
                        )
                if off < least_m:
                    is_better, least_m = True, off
                    best[:] = place
            if (
                not is_better
                or not _stays_a_surface(
                    faces, starts, of_vertex, is_rim, is_merged, seen_from, a, b
                )
                or _turns(positions, planes, faces, starts, of_vertex, a, b, best)
                or _turns(positions, planes, faces, starts, of_vertex, b, a, best)
            ):
                continue
            positions[a] = best
            off_m[a] = max(off_m[a], off_m[b]) + least_m
            is_rim[a] |= is_rim[b]
            is_merged[a] = is_merged[b] = True
            _merge_faces(planes, positions, faces, starts, of_vertex, a, b)


@njit(nogil=True)
def _merge_faces(
    planes: Floats,
    positions: Floats,
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    a: int,
    b: int,
) -> None:  # pragma: no cover - compiled
    """Give b's triangles to a, and mark those that have both as gone."""
    for face in of_vertex[starts[b] : starts[b + 1]]:
        if faces[face, 0] == GONE:
            continue
        if has(faces, face, a):
            faces[face, 0] = GONE
            continue
        for k in range(3):
            if faces[face, k] == b:
                faces[face, k] = a
        set_plane(planes, positions, faces, face)
    for face in of_vertex[starts[a] : starts[a + 1]]:
        if faces[face, 0] != GONE:
            set_plane(planes, positions, faces, face)


@njit(nogil=True)
def _centre(
    planes: Floats,
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    a: int,
    b: int,
    place: Floats,
) -> None:  # pragma: no cover - compiled
    """Move a place along the mean normal about it, to the middle between the planes there."""
    low, high = math.inf, -math.inf
    u = v = w = 0.0
    for vertex in (a, b):
        for face in of_vertex[starts[vertex] : starts[vertex + 1]]:
            if faces[face, 0] != GONE:
                x, y, z, offset = planes[face]
                above = x * place[0] + y * place[1] + z * place[2] + offset
                low, high = min(low, above), max(high, above)
                u, v, w = u + x, v + y, w + z
    length = math.sqrt(u * u + v * v + w * w)
    if length > 0:
        down = 0.5 * (low + high) / length
        place[0] -= down * u
        place[1] -= down * v
        place[2] -= down * w


@njit(nogil=True)
def _stays_a_surface(
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    is_rim: Flags,
    is_merged: Flags,
    seen_from: Indices,
    a: int,
    b: int,
) -> bool:  # pragma: no cover - compiled
    """Whether every edge joins as many triangles as before when a and b are one vertex.

    `seen_from` is room for a mark on each vertex.
    """
    shared = 0
    for face in of_vertex[starts[a] : starts[a + 1]]:
        if faces[face, 0] == GONE:
            continue
        is_shared = has(faces, face, b)
        shared += is_shared
        for k in range(3):
            corner = faces[face, k]
            if corner in (a, b):
                continue
            seen_from[corner] = a
            # With three triangles around it, two would be left, back to back.
            if is_shared and (
                is_merged[corner]
                or (not is_rim[corner] and valence(faces, starts, of_vertex, corner) < 4)
            ):
                return False
    are_rim = is_rim[a] and is_rim[b]
    if shared != (1 if are_rim else 2):  # of two rims, or of an edge of more triangles, no
        return False
    common = 0
    for face in of_vertex[starts[b] : starts[b + 1]]:
        if faces[face, 0] == GONE:
            continue
        for k in range(3):
            corner = faces[face, k]
            if corner not in (a, b) and seen_from[corner] == a:
                seen_from[corner] = -1
                common += 1
    return common == shared


@njit(nogil=True)
def _off_rim(
    positions: Floats,
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    is_rim: Flags,
    vertex: int,
    place: Floats,
) -> float:  # pragma: no cover - compiled
    """Return how far at most a place is from the lines of the rim through a vertex."""
    off = 0.0
    for face in of_vertex[starts[vertex] : starts[vertex + 1]]:
        for k in range(3):
            other = faces[face, k]
            if faces[face, 0] == GONE or other == vertex or not is_rim[other]:
                continue
            if shared_count(faces, starts, of_vertex, vertex, other) != 1:
                continue
            length2 = along = distance2 = 0.0
            for i in range(3):
                edge = positions[other, i] - positions[vertex, i]
                way = place[i] - positions[vertex, i]
                length2 += edge * edge
                along += edge * way
                distance2 += way * way
            off = max(off, math.sqrt(max(distance2 - along * along / max(length2, 1e-300), 0.0)))
    return off


@njit(nogil=True)
def _turns(
    positions: Floats,
    planes: Floats,
    faces: Indices,
    starts: Indices,
    of_vertex: Indices,
    vertex: int,
    other: int,
    place: Floats,
) -> bool:  # pragma: no cover - compiled
    """Whether a triangle of `vertex` that `other` has no part in turns when it moves to `place`."""
    for face in of_vertex[starts[vertex] : starts[vertex + 1]]:
        if faces[face, 0] == GONE or has(faces, face, other):
            continue
        k = 0
        while faces[face, k] != vertex:
            k += 1
        x, y, z = area_normal(
            place, positions[faces[face, (k + 1) % 3]], positions[faces[face, (k + 2) % 3]]
        )
        area = math.sqrt(x * x + y * y + z * z)
        u, v, w, _ = planes[face]
        if x * u + y * v + z * w <= _ALIKE * area and (u != 0 or v != 0 or w != 0):
            return True
    return False
