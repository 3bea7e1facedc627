"""What is seen through each pixel, found with rays: a G-buffer that needs no OpenGL.

Input  : triangles with their materials, a ground, a camera.
Output : surfaces, laid out as in surface_rows.py.
Cost   : 4 to 6 ms at 640×480 on two cores, half of it Embree's; only zeros are kept from picture
         to picture.
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
from render.rays.triangle_look import (
    HIT_DISTANCE,
    HIT_FACE,
    HIT_U,
    HIT_V,
    ROWS,
    TILE_WORDS,
    add_textures,
    face_viewer,
    place_on_triangles,
    reflect_as_painted,
)
from render.rays.vector_copy import copy_lanes

_FAR_M = np.float32(1e30)
_STEP = np.float32(SIDE)
_AT = tuple(np.uint64(LANES * row) for row in range(ROWS))  # known apart, for vector loops

_DISTANCE, _U, _V, _FACE, _GEOMETRY = 8, 15, 16, 17, 18  # rows of a `hit_packet`

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
    rays, valid = hit_packet()
    ray = rays.reshape(-1)  # of one axis, as all below: their rows are known apart
    words = ray.view(np.int32)
    hits, seen = np.empty(LANES * TILE_WORDS, np.float32), np.empty(ROWS * LANES, np.float32)
    hit_words, seen_words = hits.view(np.int32), seen.view(np.int32)
    flat = surfaces.reshape(-1)
    fields, columns = np.uint64(surfaces.shape[2]), np.uint64(surfaces.shape[3])
    for first in range(1, surfaces.shape[3] - 1, LANES):
        some = False
        for tile in range(LANES):
            _aim(view, ground, SIDE * (first - 1 + tile), SIDE * (row - 1), ray, words)
            is_met = _select(sphere, ray, valid)
            if is_met:
                coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
            _keep(ray, words, is_met, np.uint64(TILE_WORDS * tile), hits, hit_words)
            some |= is_met
        for lane in range(LANES):
            _show_ground(
                view, ground, lane % SIDE, SIDE * (row - 1) + lane // SIDE, first, seen, seen_words
            )
            if some:
                is_met, is_textured = place_on_triangles(
                    hits, hit_words, lane, positions, attributes, faces, mesh_of_face, factors,
                    textures, seen, seen_words,
                )  # fmt: skip
                if is_met:
                    face_viewer(view, seen)
                if is_textured:
                    add_textures(
                        hits, lane, view, positions, attributes, faces, mesh_of_face, textures,
                        texels, seen, seen_words,
                    )  # fmt: skip
                if is_met:
                    reflect_as_painted(seen, seen_words)
            start = np.uint64(row * LANES + lane) * fields * columns + np.uint64(first)
            _write(seen, fields, columns, start, flat)


@njit(nogil=True, error_model="numpy")
def _show_ground(
    view: _FLOATS,
    ground: _FLOATS,
    x: int,
    y: int,
    first: int,
    seen: _FLOATS,
    seen_words: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Set a lane's pixels in tiles from `first` on to the ground, or to what they look at.

    The lane's first pixel in the picture is (x, y).
    """
    zero, one = np.float32(0), np.float32(1)
    column, line = np.float32(x - SIDE), np.float32(y)
    cx = view[1, 0] * column + view[2, 0] * line + view[3, 0]
    cy = view[1, 1] * column + view[2, 1] * line + view[3, 1]
    cz = view[1, 2] * column + view[2, 2] * line + view[3, 2]
    sx, sy, sz = _STEP * view[1, 0], _STEP * view[1, 1], _STEP * view[1, 2]
    eye_x, above, eye_z = view[0, 0], ground[0] - view[0, 1], view[0, 2]
    radius2 = ground[1] * ground[1] if ground[1] > 0 else -one
    level, side = ground[0], one if above < 0 else -one
    red, green, blue = ground[2], ground[3], ground[4]
    for i in range(np.uint64(LANES)):
        at = np.float32(np.int32(first) + np.int32(i))
        dx, dy, dz = cx + sx * at, cy + sy * at, cz + sz * at
        distance = above / dy
        px, pz = eye_x + distance * dx, eye_z + distance * dz
        met = (distance > 0) & (px * px + pz * pz <= radius2)
        seen[_AT[POSITION] + i] = px if met else dx
        seen[_AT[POSITION + 1] + i] = level if met else dy
        seen[_AT[POSITION + 2] + i] = pz if met else dz
        seen[_AT[NORMAL + 1] + i] = side if met else zero
        seen[_AT[FACE_NORMAL + 1] + i] = side if met else zero
        seen[_AT[MATT] + i] = red if met else zero
        seen[_AT[MATT + 1] + i] = green if met else zero
        seen[_AT[MATT + 2] + i] = blue if met else zero
        seen[_AT[KIND] + i] = np.float32(GROUND) if met else np.float32(NOTHING)
        seen[_AT[NORMAL] + i] = seen[_AT[NORMAL + 2] + i] = zero
        seen[_AT[FACE_NORMAL] + i] = seen[_AT[FACE_NORMAL + 2] + i] = zero
        seen[_AT[F0] + i] = seen[_AT[F0 + 1] + i] = seen[_AT[F0 + 2] + i] = zero
        seen[_AT[F90] + i] = seen[_AT[ALPHA2] + i] = zero
    for i in range(np.uint64(LANES)):
        seen_words[_AT[TRIANGLE] + i] = -1
        seen[_AT[U] + i] = seen[_AT[V] + i] = zero


@njit(nogil=True, error_model="numpy")
def _aim(
    view: _FLOATS, ground: _FLOATS, x: int, y: int, ray: _FLOATS, words: NDArray[np.int32]
) -> None:  # pragma: no cover - compiled
    """Set the rays of the tile whose first pixel is (x, y), each as long as the ground lets it."""
    eye_x, eye_y, eye_z = view[0, 0], view[0, 1], view[0, 2]
    ax, ay, az = view[1, 0], view[1, 1], view[1, 2]
    bx, by, bz = view[2, 0], view[2, 1], view[2, 2]
    cx, cy, cz = view[3, 0], view[3, 1], view[3, 2]
    above, radius = ground[0] - eye_y, ground[1]
    for lane in range(np.uint64(LANES)):
        column = np.float32(np.int32(x) + (np.int32(lane) & np.int32(3)))
        line = np.float32(np.int32(y) + (np.int32(lane) >> np.int32(2)))
        dx = ax * column + bx * line + cx
        dy = ay * column + by * line + cy
        dz = az * column + bz * line + cz
        distance = above / dy
        across, along = eye_x + distance * dx, eye_z + distance * dz
        is_met = (
            (distance > 0) & (radius > 0) & (across * across + along * along <= radius * radius)
        )
        ray[_AT[0] + lane], ray[_AT[1] + lane], ray[_AT[2] + lane] = eye_x, eye_y, eye_z
        ray[_AT[3] + lane] = 0
        ray[_AT[4] + lane], ray[_AT[5] + lane], ray[_AT[6] + lane] = dx, dy, dz
        ray[_AT[_DISTANCE] + lane] = distance if is_met else _FAR_M
    for lane in range(np.uint64(LANES)):
        words[_AT[_GEOMETRY] + lane] = -1


@njit(nogil=True, error_model="numpy")
def _select(
    sphere: _FLOATS, ray: _FLOATS, valid: NDArray[np.int32]
) -> bool:  # pragma: no cover - compiled
    """Mark the rays that meet the sphere; return whether any does."""
    dx, dy, dz = sphere[0] - ray[0], sphere[1] - ray[_AT[1]], sphere[2] - ray[_AT[2]]
    excess = dx * dx + dy * dy + dz * dz - sphere[3] * sphere[3]
    some = np.int32(0)
    for lane in range(np.uint64(LANES)):
        x, y, z = ray[_AT[4] + lane], ray[_AT[5] + lane], ray[_AT[6] + lane]
        along = dx * x + dy * y + dz * z
        ahead = (along > 0) & (along * along >= excess * (x * x + y * y + z * z))
        is_met = -np.int32(ahead | (excess <= 0))
        valid[lane] = is_met
        some |= is_met
    return bool(some != 0)


@njit(nogil=True, error_model="numpy")
def _keep(
    ray: _FLOATS,
    words: NDArray[np.int32],
    is_traced: bool,
    tile: np.uint64,
    hits: _FLOATS,
    hit_words: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Set `hits`, from `tile` on, to those of a packet, if it was traced."""
    for lane in range(np.uint64(LANES)):
        face = words[_AT[_FACE] + lane] if words[_AT[_GEOMETRY] + lane] != -1 else np.int32(-1)
        hit_words[tile + _AT[HIT_FACE] + lane] = face
    if not is_traced:
        return
    copy_lanes(ray, _AT[_DISTANCE], hits, tile + _AT[HIT_DISTANCE])  # type: ignore[call-arg]
    copy_lanes(ray, _AT[_U], hits, tile + _AT[HIT_U])
    copy_lanes(ray, _AT[_V], hits, tile + _AT[HIT_V])


@njit(nogil=True, error_model="numpy")
def _write(
    seen: _FLOATS, fields: np.uint64, columns: np.uint64, start: np.uint64, surfaces: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Copy a lane's pixels to surfaces, from `start` on, but for zeros that are there from before.

    Nothing has only a direction, and the ground mirrors nothing.
    """
    kinds = start + np.uint64(KIND) * columns
    shows = has_triangles = np.int32(0)
    for i in range(np.uint64(LANES)):
        kind, before = seen[_AT[KIND] + i], surfaces[kinds + i]
        shows |= np.int32((kind != NOTHING) | (before != NOTHING))
        has_triangles |= np.int32((kind > GROUND) | (before > GROUND))
    stop = KIND if has_triangles else F0 if shows else POSITION + 3
    for field in range(np.uint64(stop)):
        copy_lanes(seen, field * np.uint64(LANES), surfaces, start + field * columns)  # type: ignore[call-arg]
    for field in range(np.uint64(KIND), fields):
        copy_lanes(seen, field * np.uint64(LANES), surfaces, start + field * columns)  # type: ignore[call-arg]
