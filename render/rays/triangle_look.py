"""What a triangle looks like where a ray meets it: place, normals and material.

Input  : tables of triangles and materials, as in `Geometry` and `Appearance`.
Output : one lane of surfaces (FIELDS, LANES), as in surface_rows.py.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.rays.surface_rows import (
    ALPHA2,
    DULL,
    F0,
    F90,
    FACE_NORMAL,
    GLOSSY,
    KIND,
    MATT,
    NORMAL,
    POSITION,
)
from render.scenes.texture_pyramid import texture_colour

_DIELECTRIC_F0 = np.float32(0.04)  # refractive index 1.5, as in glTF
_TINY = np.float32(1e-30)
_BY_PI = np.float32(1 / math.pi)

_FLOATS = NDArray[np.float32]


@njit(nogil=True, error_model="numpy")
def place_on_triangle(
    face: int,
    u: np.float32,
    v: np.float32,
    view: _FLOATS,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    lane: int,
    seen: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set position and normals of `lane` to those of a triangle at barycentric coordinates."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    w = np.float32(1) - u - v
    for axis in range(3):
        seen[POSITION + axis, lane] = (
            w * positions[a, axis] + u * positions[b, axis] + v * positions[c, axis]
        )
        seen[NORMAL + axis, lane] = (
            w * attributes[a, axis] + u * attributes[b, axis] + v * attributes[c, axis]
        )
    ex = positions[b, 0] - positions[a, 0]
    ey = positions[b, 1] - positions[a, 1]
    ez = positions[b, 2] - positions[a, 2]
    gx = positions[c, 0] - positions[a, 0]
    gy = positions[c, 1] - positions[a, 1]
    gz = positions[c, 2] - positions[a, 2]
    fx, fy, fz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
    # Both normals look to the viewer's side, as gbuffer.frag has them.
    toward = (
        fx * (view[0, 0] - seen[POSITION, lane])
        + fy * (view[0, 1] - seen[POSITION + 1, lane])
        + fz * (view[0, 2] - seen[POSITION + 2, lane])
    )
    length = math.sqrt(fx * fx + fy * fy + fz * fz)
    scale = (np.float32(1) if toward >= 0 else np.float32(-1)) / (length + _TINY)
    fx, fy, fz = fx * scale, fy * scale, fz * scale
    nx, ny, nz = seen[NORMAL, lane], seen[NORMAL + 1, lane], seen[NORMAL + 2, lane]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > _TINY:
        agrees = nx * fx + ny * fy + nz * fz >= 0
        scale = (np.float32(1) if agrees else np.float32(-1)) / length
        nx, ny, nz = nx * scale, ny * scale, nz * scale
    else:
        nx, ny, nz = fx, fy, fz
    seen[NORMAL, lane], seen[NORMAL + 1, lane], seen[NORMAL + 2, lane] = nx, ny, nz
    seen[FACE_NORMAL, lane] = fx
    seen[FACE_NORMAL + 1, lane] = fy
    seen[FACE_NORMAL + 2, lane] = fz


@njit(nogil=True, error_model="numpy")
def footprint_of(
    face: int,
    distance: np.float32,
    view: _FLOATS,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    lane: int,
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
    vx = view[0, 0] - seen[POSITION, lane]
    vy = view[0, 1] - seen[POSITION + 1, lane]
    vz = view[0, 2] - seen[POSITION + 2, lane]
    facing = vx * seen[FACE_NORMAL, lane] + vy * seen[FACE_NORMAL + 1, lane]
    facing = (facing + vz * seen[FACE_NORMAL + 2, lane]) / math.sqrt(vx * vx + vy * vy + vz * vz)
    step = math.sqrt(view[1, 0] ** 2 + view[1, 1] ** 2 + view[1, 2] ** 2)
    return np.float32(density * distance * step / max(facing, np.float32(0.01)))


@njit(nogil=True, error_model="numpy")
def paint_triangle(
    face: int,
    u: np.float32,
    v: np.float32,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    factors: _FLOATS,
    textures: NDArray[np.int64],
    texels: _FLOATS,
    mesh: int,
    footprint: np.float32,
    lane: int,
    seen: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set how `lane` reflects to the material of a triangle at barycentric coordinates."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    w = np.float32(1) - u - v
    rough, metal, specular = factors[mesh, 3], factors[mesh, 4], factors[mesh, 5]
    for i in range(3):
        tint = w * attributes[a, 5 + i] + u * attributes[b, 5 + i] + v * attributes[c, 5 + i]
        seen[F0 + i, lane] = factors[mesh, i] * tint
    s = w * attributes[a, 3] + u * attributes[b, 3] + v * attributes[c, 3]
    t = w * attributes[a, 4] + u * attributes[b, 4] + v * attributes[c, 4]
    if textures[mesh, 0, 3] > 0:
        red, green, blue = texture_colour(textures[mesh, 0], texels, s, t, footprint)
        seen[F0, lane] *= red
        seen[F0 + 1, lane] *= green
        seen[F0 + 2, lane] *= blue
    if textures[mesh, 1, 3] > 0:
        of_rough, of_metal, _ = texture_colour(textures[mesh, 1], texels, s, t, footprint)
        rough, metal = rough * np.float32(of_rough), metal * np.float32(of_metal)
    plain = (np.float32(1) - metal) * _DIELECTRIC_F0 * specular
    matt = (np.float32(1) - metal) * _BY_PI
    for i in range(3):
        base = seen[F0 + i, lane]
        seen[MATT + i, lane] = matt * base
        seen[F0 + i, lane] = plain + metal * base
    seen[F90, lane] = (np.float32(1) - metal) * specular + metal
    seen[ALPHA2, lane] = rough**4
    seen[KIND, lane] = GLOSSY if seen[F90, lane] > 0 else DULL
