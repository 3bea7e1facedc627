"""What a triangle looks like where a ray meets it: place, normals and material.

Input  : tables of triangles and materials, as in `Geometry` and `Appearance`.
Output : surfaces of one lane in 16 tiles.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.rays.surface_rows import (
    ALPHA2,
    DULL,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    GLOSSY,
    KIND,
    LANES,
    MATT,
    NORMAL,
    POSITION,
    TRIANGLE,
    U,
    V,
)
from render.scenes.texture_pyramid import texture_colour

ROWS = FIELDS + 3
HIT_DISTANCE, HIT_U, HIT_V, HIT_FACE = 0, 1, 2, 3
TILE_WORDS = 4 * LANES
"""Rows of hits: distance, u, v, the bits of a triangle's row, −1 for none; how many numbers those
of a tile are."""

_AT = tuple(np.uint64(LANES * row) for row in range(ROWS))  # known apart, for vector loops
_DIELECTRIC_F0 = np.float32(0.04)  # refractive index 1.5, as in glTF
_TINY = np.float32(1e-30)
_BY_PI = np.float32(1 / math.pi)

_FLOATS = NDArray[np.float32]


@njit(nogil=True, error_model="numpy")
def place_on_triangles(
    hits: _FLOATS,
    hit_words: NDArray[np.int32],
    lane: int,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    mesh_of_face: NDArray[np.int32],
    factors: _FLOATS,
    textures: NDArray[np.int64],
    seen: _FLOATS,
    seen_words: NDArray[np.int32],
) -> tuple[bool, bool]:  # pragma: no cover - compiled
    """Set what hit a triangle to its place and paint; return whether any did, and has textures.

    Normals are of any length and side until `face_viewer`. Base colour, roughness, metalness and
    specular weight lie in MATT, ALPHA2, F0 and F90 until `reflect_as_painted`.

    Parameters
    ----------
    hits, hit_words : (LANES · TILE_WORDS,) float32 and int32
        Of 16 tiles, one after another.
    seen, seen_words : (ROWS · LANES,) float32 and int32
        The pixels of one lane in these tiles, fields as in surface_rows.py.
    """
    is_met = is_textured = False
    for i in range(np.uint64(LANES)):
        at = i * np.uint64(TILE_WORDS) + np.uint64(lane)
        face = hit_words[at + _AT[HIT_FACE]]
        if face < 0:
            continue
        is_met = True
        a, b, c = np.uint64(faces[face, 0]), np.uint64(faces[face, 1]), np.uint64(faces[face, 2])
        u, v, mesh = hits[at + _AT[HIT_U]], hits[at + _AT[HIT_V]], np.uint64(mesh_of_face[face])
        w = np.float32(1) - u - v
        seen_words[_AT[TRIANGLE] + i] = face
        seen[_AT[U] + i], seen[_AT[V] + i] = u, v
        ex, gx = positions[b, 0] - positions[a, 0], positions[c, 0] - positions[a, 0]
        ey, gy = positions[b, 1] - positions[a, 1], positions[c, 1] - positions[a, 1]
        ez, gz = positions[b, 2] - positions[a, 2], positions[c, 2] - positions[a, 2]
        seen[_AT[FACE_NORMAL] + i] = ey * gz - ez * gy
        seen[_AT[FACE_NORMAL + 1] + i] = ez * gx - ex * gz
        seen[_AT[FACE_NORMAL + 2] + i] = ex * gy - ey * gx
        for axis in range(3):
            seen[np.uint64(LANES * (POSITION + axis)) + i] = (
                w * positions[a, axis] + u * positions[b, axis] + v * positions[c, axis]
            )
            seen[np.uint64(LANES * (NORMAL + axis)) + i] = (
                w * attributes[a, axis] + u * attributes[b, axis] + v * attributes[c, axis]
            )
            tint = w * attributes[a, 5 + axis] + u * attributes[b, 5 + axis]
            tint += v * attributes[c, 5 + axis]
            seen[np.uint64(LANES * (MATT + axis)) + i] = factors[mesh, axis] * tint
        seen[_AT[ALPHA2] + i] = factors[mesh, 3]
        seen[_AT[F0] + i] = factors[mesh, 4]
        seen[_AT[F90] + i] = factors[mesh, 5]
        is_textured |= textures[mesh, 0, 3] > 0 or textures[mesh, 1, 3] > 0
    return is_met, is_textured


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def face_viewer(view: _FLOATS, seen: _FLOATS) -> None:  # pragma: no cover - compiled
    """Turn both normals of triangles to the viewer's side, as gbuffer.frag has them; make them 1.

    Those of the ground stay: they are so already.
    """
    one = np.float32(1)
    ex, ey, ez = view[0, 0], view[0, 1], view[0, 2]
    for i in range(np.uint64(LANES)):
        fx, fy, fz = (
            seen[_AT[FACE_NORMAL] + i],
            seen[_AT[FACE_NORMAL + 1] + i],
            seen[_AT[FACE_NORMAL + 2] + i],
        )
        toward = (
            fx * (ex - seen[_AT[POSITION] + i])
            + fy * (ey - seen[_AT[POSITION + 1] + i])
            + fz * (ez - seen[_AT[POSITION + 2] + i])
        )
        length = np.float32(math.sqrt(fx * fx + fy * fy + fz * fz))
        scale = (one if toward >= 0 else -one) / (length + _TINY)
        fx, fy, fz = fx * scale, fy * scale, fz * scale
        nx, ny, nz = (
            seen[_AT[NORMAL] + i],
            seen[_AT[NORMAL + 1] + i],
            seen[_AT[NORMAL + 2] + i],
        )
        length = np.float32(math.sqrt(nx * nx + ny * ny + nz * nz))
        scale = (one if nx * fx + ny * fy + nz * fz >= 0 else -one) / max(length, _TINY)
        has_normal = length > _TINY
        seen[_AT[NORMAL] + i] = nx * scale if has_normal else fx
        seen[_AT[NORMAL + 1] + i] = ny * scale if has_normal else fy
        seen[_AT[NORMAL + 2] + i] = nz * scale if has_normal else fz
        seen[_AT[FACE_NORMAL] + i] = fx
        seen[_AT[FACE_NORMAL + 1] + i] = fy
        seen[_AT[FACE_NORMAL + 2] + i] = fz


@njit(nogil=True, error_model="numpy")
def footprint_of(
    face: int,
    distance: np.float32,
    view: _FLOATS,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    i: int,
    seen: _FLOATS,
) -> np.float32:  # pragma: no cover - compiled
    """Return how much of a texture, as a length, the longer side of a pixel covers."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    ex, ey, ez = (
        positions[b, 0] - positions[a, 0],
        positions[b, 1] - positions[a, 1],
        positions[b, 2] - positions[a, 2],
    )
    gx, gy, gz = (
        positions[c, 0] - positions[a, 0],
        positions[c, 1] - positions[a, 1],
        positions[c, 2] - positions[a, 2],
    )
    area2 = (ey * gz - ez * gy) ** 2 + (ez * gx - ex * gz) ** 2 + (ex * gy - ey * gx) ** 2
    covered = abs(
        (attributes[b, 3] - attributes[a, 3]) * (attributes[c, 4] - attributes[a, 4])
        - (attributes[b, 4] - attributes[a, 4]) * (attributes[c, 3] - attributes[a, 3])
    )
    density = math.sqrt(covered / max(math.sqrt(area2), _TINY))
    vx = view[0, 0] - seen[_AT[POSITION] + i]
    vy = view[0, 1] - seen[_AT[POSITION + 1] + i]
    vz = view[0, 2] - seen[_AT[POSITION + 2] + i]
    facing = vx * seen[_AT[FACE_NORMAL] + i] + vy * seen[_AT[FACE_NORMAL + 1] + i]
    facing = facing + vz * seen[_AT[FACE_NORMAL + 2] + i]
    facing /= math.sqrt(vx * vx + vy * vy + vz * vz)
    step = math.sqrt(view[1, 0] ** 2 + view[1, 1] ** 2 + view[1, 2] ** 2)
    return np.float32(density * distance * step / max(facing, np.float32(0.01)))


@njit(nogil=True, error_model="numpy")
def add_textures(
    hits: _FLOATS,
    lane: int,
    view: _FLOATS,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    mesh_of_face: NDArray[np.int32],
    textures: NDArray[np.int64],
    texels: _FLOATS,
    seen: _FLOATS,
    seen_words: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Scale base colours, roughness and metalness of triangles by what their textures say."""
    for i in range(np.uint64(LANES)):
        face = seen_words[_AT[TRIANGLE] + i]
        if face < 0:
            continue
        mesh = mesh_of_face[face]
        if textures[mesh, 0, 3] == 0 and textures[mesh, 1, 3] == 0:
            continue
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        u, v = seen[_AT[U] + i], seen[_AT[V] + i]
        w = np.float32(1) - u - v
        s = w * attributes[a, 3] + u * attributes[b, 3] + v * attributes[c, 3]
        t = w * attributes[a, 4] + u * attributes[b, 4] + v * attributes[c, 4]
        distance = hits[i * np.uint64(TILE_WORDS) + _AT[HIT_DISTANCE] + np.uint64(lane)]
        footprint = footprint_of(face, distance, view, positions, attributes, faces, i, seen)
        if textures[mesh, 0, 3] > 0:
            red, green, blue = texture_colour(textures[mesh, 0], texels, s, t, footprint)
            seen[_AT[MATT] + i] *= red
            seen[_AT[MATT + 1] + i] *= green
            seen[_AT[MATT + 2] + i] *= blue
        if textures[mesh, 1, 3] > 0:
            of_rough, of_metal, _ = texture_colour(textures[mesh, 1], texels, s, t, footprint)
            seen[_AT[ALPHA2] + i] *= of_rough
            seen[_AT[F0] + i] *= of_metal


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def reflect_as_painted(
    seen: _FLOATS, seen_words: NDArray[np.int32]
) -> None:  # pragma: no cover - compiled
    """Set how triangles reflect to what their paint says."""
    one = np.float32(1)
    for i in range(np.uint64(LANES)):
        is_painted = seen_words[_AT[TRIANGLE] + i] >= 0
        red, green, blue = (
            seen[_AT[MATT] + i],
            seen[_AT[MATT + 1] + i],
            seen[_AT[MATT + 2] + i],
        )
        rough, metal, specular = seen[_AT[ALPHA2] + i], seen[_AT[F0] + i], seen[_AT[F90] + i]
        plain, matt = (one - metal) * _DIELECTRIC_F0 * specular, (one - metal) * _BY_PI
        f90 = (one - metal) * specular + metal
        kind = np.float32(GLOSSY) if f90 > 0 else np.float32(DULL)
        seen[_AT[MATT] + i] = matt * red if is_painted else red
        seen[_AT[MATT + 1] + i] = matt * green if is_painted else green
        seen[_AT[MATT + 2] + i] = matt * blue if is_painted else blue
        seen[_AT[F0] + i] = plain + metal * red if is_painted else np.float32(0)
        seen[_AT[F0 + 1] + i] = plain + metal * green if is_painted else np.float32(0)
        seen[_AT[F0 + 2] + i] = plain + metal * blue if is_painted else np.float32(0)
        seen[_AT[F90] + i] = f90 if is_painted else np.float32(0)
        seen[_AT[ALPHA2] + i] = rough * rough * rough * rough if is_painted else np.float32(0)
        seen[_AT[KIND] + i] = kind if is_painted else seen[_AT[KIND] + i]
