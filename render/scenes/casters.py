"""What casts shadows: all triangles of a scene in one list, prepared for drawing maps of depth.

Input  : meshes.    Output : Casters.    Cost : once per scene; about 0.5 s per million triangles.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.scenes.scene import Mesh


@dataclass(frozen=True)
class Casters:
    """Triangles that cast shadows.

    Attributes
    ----------
    positions : (V, 3) float32
        Equal positions are merged: a map of depth costs time per vertex.
    closed_faces : (F, 3) int32
        Triangles of closed meshes, wound to be counter-clockwise from outside. Light from outside
        meets such a mesh on a triangle that faces it, so the others need not be drawn.
    open_faces : (G, 3) int32
        Triangles of all other meshes, which cast from both sides.
    centre, radius_m : (3,) float64, float
        A sphere around them, about the middle of their bounding box; (0, 0) if there are none.
    error_m : float
        How far they may be off what they stand for.
    """

    positions: NDArray[np.float32]
    closed_faces: NDArray[np.int32]
    open_faces: NDArray[np.int32]
    centre: NDArray[np.float64]
    radius_m: float
    error_m: float = 0.0


def gather_casters(meshes: Sequence[Mesh]) -> Casters:
    """Return the triangles of `meshes`; those with two equal corners are left out."""
    none = np.zeros((0, 3), np.int32)
    if not meshes:
        return Casters(none.astype(np.float32), none, none, np.zeros(3), 0.0)
    merged = [_merge(mesh) for mesh in meshes]
    offsets = np.cumsum([0, *(len(positions) for positions, _ in merged)])
    closed, opened = [none], [none]
    for (positions, faces), offset in zip(merged, offsets[:-1], strict=True):
        if is_closed(faces, len(positions)):
            outward = faces if signed_volume(positions, faces) > 0 else faces[:, ::-1]
            closed.append(outward + np.int32(offset))
        else:
            opened.append(faces + np.int32(offset))
    positions = np.concatenate([positions for positions, _ in merged])
    low, high = positions.min(axis=0).astype(np.float64), positions.max(axis=0)
    centre = 0.5 * (low + high)
    radius_m = float(np.linalg.norm(positions - centre, axis=1).max())
    return Casters(positions, np.concatenate(closed), np.concatenate(opened), centre, radius_m)


def is_closed(faces: NDArray[np.int32], vertex_count: int) -> bool:
    """Whether every edge joins exactly two triangles, which run along it in opposite directions."""
    start = faces.reshape(-1).astype(np.int64)
    end = np.roll(faces, -1, axis=1).reshape(-1).astype(np.int64)
    forward = np.sort(start * vertex_count + end)
    backward = np.sort(end * vertex_count + start)
    return bool(np.all(np.diff(forward) > 0) and np.array_equal(forward, backward))


def signed_volume(positions: NDArray[np.float32], faces: NDArray[np.int32]) -> float:
    """Volume inside a closed mesh, negative if its triangles are clockwise from outside."""
    a, b, c = positions.astype(np.float64)[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a - a[:1], np.cross(b - a[:1], c - a[:1]))) / 6


def _merge(mesh: Mesh) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    positions, index = np.unique(mesh.positions, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces].astype(np.int32)
    a, b, c = faces.T
    return positions, faces[(a != b) & (b != c) & (c != a)]
