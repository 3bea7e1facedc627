"""What is seen through each pixel, found with rays: a G-buffer that needs no OpenGL.

Input  : triangles with their materials, a ground, a camera.
Output : `Surfaces`, ordered for loops that treat 16 pixels at a time.
Cost   : about 7 ms at 640×480 on two cores; nothing is kept from picture to picture.
Fails  : one ray a sample: a triangle narrower than a pixel is seen or missed as a whole.

Pixels come in tiles of 4 × 4. A pixel's place in its tile is its lane, 4 row + column, and the
pixels of one lane in a row of tiles lie side by side: a loop over them runs over neighbours of
neighbours, which do alike. A border of one empty tile saves the loops their borders.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.embree import coherent16, hit_packet
from render.scenes.texture_pyramid import texture_colour

LANES = 16
"""Pixels of a tile, and rays of a packet."""

SIDE = 4
"""Pixels along the side of a tile."""

POSITION, NORMAL, FACE_NORMAL, MATT, F0 = 0, 3, 6, 9, 12
F90, ALPHA2, KIND = 15, 16, 17
FIELDS = 18
"""Rows of a surface: position (3), shading normal (3), face normal (3), ρ/π (3), f0 (3), f90, α²
and what it is. Where nothing is hit, `POSITION` is the direction of the ray instead."""

TRIANGLE, U, V = 18, 19, 20
"""Three rows more for those who ask for them: the bits of a triangle's row, −1 off the triangles;
the shares of its second and third corner."""

NOTHING, GROUND, DULL, GLOSSY = 0.0, 1.0, 2.0, 3.0
"""Values of `KIND`: nothing was hit, the ground, a Lambertian surface, one that mirrors too."""

_DIELECTRIC_F0 = np.float32(0.04)  # refractive index 1.5, as in glTF
_FAR_M = np.float32(1e30)
_TINY = np.float32(1e-30)
_BY_PI = np.float32(1 / math.pi)

_FLOATS = NDArray[np.float32]


def empty_surfaces(size_px: tuple[int, int], fields: int = FIELDS) -> _FLOATS:
    """Return memory for a picture's surfaces, (rows + 2, LANES, fields, columns + 2) of tiles.

    Columns are a multiple of 16, so a picture may reach over its right and lower edge.
    """
    width, height = size_px
    columns = LANES * math.ceil(width / (SIDE * LANES))
    rows = SIDE * math.ceil(height / SIDE**2)
    return np.zeros((rows + 2, LANES, fields, columns + 2), np.float32)


def in_picture(surfaces: _FLOATS, size_px: tuple[int, int]) -> _FLOATS:
    """Return the surfaces as a picture, (H, W, FIELDS)."""
    width, height = size_px
    inside = surfaces[1:-1, ..., 1:-1]
    rows, _, fields, columns = inside.shape
    lanes = inside.reshape(rows, SIDE, SIDE, fields, columns).transpose(0, 1, 4, 2, 3)
    return lanes.reshape(SIDE * rows, SIDE * columns, fields)[:height, :width]


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def find_surfaces(
    function: int,
    scene: int,
    sphere: _FLOATS,
    view: _FLOATS,
    ground: _FLOATS,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    mesh_of_face: NDArray[np.int32],
    factors: _FLOATS,
    textures: NDArray[np.int64],
    texels: _FLOATS,
    surfaces: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Fill `surfaces`, of `empty_surfaces`, inside its border.

    Parameters
    ----------
    function, scene : int
        Addresses of Embree's rtcIntersect16 and scene.
    sphere : (4,) float32
        Centre and radius of the triangles' bounding sphere.
    view : (4, 3) float32
        The eye; then what a column, a row and 1 add to a ray's direction.
    ground : (5,) float32
        Height, radius (negative without a ground) and ρ/π (3) of a disc about the y axis.
    positions, attributes, faces, mesh_of_face, factors, textures, texels
        As in `Geometry` and `Appearance`.
    """
    for row in prange(1, surfaces.shape[0] - 1):
        _find_row(
            function, scene, sphere, view, ground, positions, attributes, faces, mesh_of_face,
            factors, textures, texels, row, surfaces,
        )  # fmt: skip


@njit(nogil=True, error_model="numpy")
def _find_row(
    function: int,
    scene: int,
    sphere: _FLOATS,
    view: _FLOATS,
    ground: _FLOATS,
    positions: _FLOATS,
    attributes: _FLOATS,
    faces: NDArray[np.int32],
    mesh_of_face: NDArray[np.int32],
    factors: _FLOATS,
    textures: NDArray[np.int64],
    texels: _FLOATS,
    row: int,
    surfaces: _FLOATS,
) -> None:  # pragma: no cover - compiled
    for lane in range(LANES):
        _show_ground(
            view, ground, lane % SIDE, SIDE * (row - 1) + lane // SIDE, surfaces[row, lane]
        )
    rays, valid = hit_packet()
    face_of, geometry_of = rays[17].view(np.int32), rays[18].view(np.int32)
    seen = np.zeros((FIELDS, LANES), np.float32)
    wants_triangles = surfaces.shape[2] > FIELDS
    for column in range(1, surfaces.shape[3] - 1):
        _aim(view, ground, SIDE * (column - 1), SIDE * (row - 1), rays)
        geometry_of[:] = -1
        if not _select(sphere, rays, valid):
            continue
        coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        for lane in range(LANES):
            if geometry_of[lane] == -1:
                continue
            mesh = mesh_of_face[face_of[lane]]
            u, v = rays[15, lane], rays[16, lane]
            _place(face_of[lane], u, v, view, positions, attributes, faces, lane, seen)
            footprint = np.float32(0)
            if textures[mesh, 0, 3] > 0 or textures[mesh, 1, 3] > 0:
                footprint = _footprint(
                    face_of[lane], rays[8, lane], view, positions, attributes, faces, lane, seen
                )
            _paint(
                face_of[lane], u, v, attributes, faces, factors, textures, texels, mesh, footprint,
                lane, seen,
            )  # fmt: skip
            for field in range(FIELDS):
                surfaces[row, lane, field, column] = seen[field, lane]
            if wants_triangles:
                surfaces[row, lane, TRIANGLE, column] = rays[17, lane]
                surfaces[row, lane, U, column] = u
                surfaces[row, lane, V, column] = v


@njit(nogil=True, error_model="numpy")
def _show_ground(
    view: _FLOATS, ground: _FLOATS, x: int, y: int, seen: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set a lane's pixels, of which the first is (x, y), to the ground or to what they look at."""
    stop = np.uint64(seen.shape[1] - 1)
    for axis in range(3):
        first = view[1, axis] * np.float32(x - SIDE) + view[2, axis] * np.float32(y) + view[3, axis]
        step = np.float32(SIDE) * view[1, axis]
        for at in range(np.uint64(1), stop):
            seen[POSITION + axis, at] = first + step * np.float32(np.int32(at))
    eye_x, above, eye_z = view[0, 0], ground[0] - view[0, 1], view[0, 2]
    radius2 = ground[1] * ground[1] if ground[1] > 0 else np.float32(-1)
    for at in range(np.uint64(1), stop):
        distance = above / seen[POSITION + 1, at]
        px = eye_x + distance * seen[POSITION, at]
        pz = eye_z + distance * seen[POSITION + 2, at]
        met = (distance > 0) & (px * px + pz * pz <= radius2)
        seen[POSITION, at] = px if met else seen[POSITION, at]
        seen[POSITION + 2, at] = pz if met else seen[POSITION + 2, at]
        seen[KIND, at] = np.float32(GROUND if met else NOTHING)
    side = np.float32(1) if above < 0 else np.float32(-1)
    for at in range(np.uint64(1), stop):
        met = seen[KIND, at] == GROUND
        seen[POSITION + 1, at] = ground[0] if met else seen[POSITION + 1, at]
        seen[NORMAL + 1, at] = side if met else np.float32(0)
        seen[FACE_NORMAL + 1, at] = side if met else np.float32(0)
    for c in range(3):
        for at in range(np.uint64(1), stop):
            seen[MATT + c, at] = ground[2 + c] if seen[KIND, at] == GROUND else np.float32(0)
    for field in (
        NORMAL,
        NORMAL + 2,
        FACE_NORMAL,
        FACE_NORMAL + 2,
        F0,
        F0 + 1,
        F0 + 2,
        F90,
        ALPHA2,
    ):
        seen[field, np.uint64(1) : stop] = 0
    if seen.shape[0] > FIELDS:
        seen[TRIANGLE].view(np.int32)[1:-1] = -1


@njit(nogil=True, error_model="numpy")
def _aim(view: _FLOATS, ground: _FLOATS, x: int, y: int, rays: _FLOATS) -> None:  # pragma: no cover
    """Set the rays of the tile whose first pixel is (x, y), each as long as the ground lets it."""
    for lane in range(LANES):
        column, line = np.float32(x + lane % SIDE), np.float32(y + lane // SIDE)
        for axis in range(3):
            rays[axis, lane] = view[0, axis]
            rays[4 + axis, lane] = view[1, axis] * column + view[2, axis] * line + view[3, axis]
        rays[3, lane] = 0
    for lane in range(LANES):
        distance = (ground[0] - view[0, 1]) / rays[5, lane]
        across = view[0, 0] + distance * rays[4, lane]
        along = view[0, 2] + distance * rays[6, lane]
        is_met = (distance > 0) & (ground[1] > 0)
        is_met &= across * across + along * along <= ground[1] * ground[1]
        rays[8, lane] = distance if is_met else _FAR_M


@njit(nogil=True, error_model="numpy")
def _select(
    sphere: _FLOATS, rays: _FLOATS, valid: NDArray[np.int32]
) -> bool:  # pragma: no cover - compiled
    """Mark the rays that meet the sphere; return whether any does."""
    dx, dy, dz = sphere[0] - rays[0, 0], sphere[1] - rays[1, 0], sphere[2] - rays[2, 0]
    excess = dx * dx + dy * dy + dz * dz - sphere[3] * sphere[3]
    some = np.int32(0)
    for lane in range(LANES):
        x, y, z = rays[4, lane], rays[5, lane], rays[6, lane]
        along = dx * x + dy * y + dz * z
        ahead = (along > 0) & (along * along >= excess * (x * x + y * y + z * z))
        valid[lane] = -np.int32(ahead | (excess <= 0))
        some |= valid[lane]
    return some != 0


@njit(nogil=True, error_model="numpy")
def _place(
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
def _footprint(
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
def _paint(
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
