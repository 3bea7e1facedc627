"""What is seen through each pixel, found with rays: a G-buffer that needs no OpenGL.

Input  : triangles with their materials, a ground, a camera.
Output : surfaces, laid out as in surface_rows.py.
Cost   : about 7 ms at 640×480 on two cores; nothing is kept from picture to picture.
Fails  : one ray a sample: a triangle narrower than a pixel is seen or missed as a whole.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.embree import coherent16, hit_packet
from render.rays.row_order import row_order
from render.rays.surface_rows import (
    ALPHA2,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    GROUND,
    KIND,
    LANES,
    MATT,
    NORMAL,
    NOTHING,
    POSITION,
    SIDE,
    TRIANGLE,
    U,
    V,
)
from render.rays.triangle_look import footprint_of, paint_triangle, place_on_triangle

_FAR_M = np.float32(1e30)

_FLOATS = NDArray[np.float32]


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
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        _find_row(
            function, scene, sphere, view, ground, positions, attributes, faces, mesh_of_face,
            factors, textures, texels, order[k], surfaces,
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
            place_on_triangle(face_of[lane], u, v, view, positions, attributes, faces, lane, seen)
            footprint = np.float32(0)
            if textures[mesh, 0, 3] > 0 or textures[mesh, 1, 3] > 0:
                footprint = footprint_of(
                    face_of[lane], rays[8, lane], view, positions, attributes, faces, lane, seen
                )
            paint_triangle(
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
