"""Ambient occlusion: how much of the sky over each visible point, or each vertex, is open.

A(p) = ∫ V(p, ω) (n·ω) dω over a cone about the normal, over the same without V: 1 in the open. What
lies farther than a distance does not count, so that a room can be dark in its corners alone.

Input  : a scene, a camera.    Output : A of each pixel, and what share of it the scene covers.
Or     : a scene.              Output : A of each vertex, on the side that its normal looks to.
Cost   : a packet of 16 rays about 1 µs; 256 rays per pixel or vertex.
Fails  : the rays leave noise of up to 0.03 where shadows of many directions meet. Vertices know
         nothing of what is between them: a shadow within a large triangle is lost.

References
----------
.. [1] S. Zhukov, A. Iones, G. Kronin, "An Ambient Light Illumination Model", EGWR 1998.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from capture.errors import InputError
from render.rays.background import picture_rays
from render.rays.embree import (
    PACKET,
    Occluders,
    hit_packet,
    intersect16_address,
    occluded16,
    occluded16_address,
    packet,
)
from render.rays.tangent_frame import tangent_frame
from render.reference.surfaces import (
    FACE_NORMAL,
    FAR_M,
    FIELDS,
    HIT,
    NORMAL,
    OFFSET,
    Floats,
    Tables,
    find_surfaces,
    scene_tables,
)
from render.scenes.scene import Camera, Scene

RAYS = 64
"""Rays of each point that is seen."""

SAMPLES_PER_AXIS = 2

VERTEX_RAYS = SAMPLES_PER_AXIS**2 * RAYS
"""Rays of a vertex: as many as of a pixel."""

_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


def ambient_occlusion(
    scene: Scene, camera: Camera, cone_rad: float = math.pi, distance_m: float = math.inf
) -> NDArray[np.float32]:
    """Return A and the coverage of each pixel, (H, W, 2), both in [0, 1].

    Where the scene covers a part of a pixel, A is the mean over that part; 0 without any.

    Parameters
    ----------
    cone_rad : float
        Full opening of the cone about the normal, up to π, all that is above a surface.
    distance_m : float
        Farther occluders do not count.

    Raises
    ------
    InputError
        If the cone is not in (0, π], or the distance not positive.
    """
    widest_sine2, distance_m = _checked(cone_rad, distance_m)
    width, height = (SAMPLES_PER_AXIS * length for length in camera.size_px)
    tables = scene_tables(scene)
    rays = np.zeros((height, -(-width // PACKET) * PACKET, 3), np.float32)
    rays[:, :width] = picture_rays(camera, (width, height))
    seen = np.zeros((*rays.shape[:2], 2), np.float32)
    with Occluders(tables.positions, tables.faces) as occluders:
        _look_around(
            (intersect16_address(), occluded16_address()),
            occluders.address,
            tables,
            camera.eye.astype(np.float32),
            rays,
            widest_sine2,
            distance_m,
            seen,
        )
    n = SAMPLES_PER_AXIS
    sums = seen[:, :width].reshape(height // n, n, width // n, n, 2).sum(axis=(1, 3))
    open_sum, hits = sums[..., 0], sums[..., 1]
    mean = np.divide(open_sum, hits, out=np.zeros_like(hits), where=hits > 0)
    return np.stack([mean, hits / n**2], axis=-1)


def vertex_occlusion(
    scene: Scene, cone_rad: float = math.pi, distance_m: float = math.inf
) -> tuple[NDArray[np.float32], ...]:
    """Return A of the vertices of each mesh, (V,) in [0, 1].

    Parameters and what is raised are those of `ambient_occlusion`.
    """
    widest_sine2, distance_m = _checked(cone_rad, distance_m)
    tables = scene_tables(scene)
    openness = np.zeros(len(tables.positions), np.float32)
    with Occluders(tables.positions, tables.faces) as occluders:
        _look_from_vertices(
            occluded16_address(), occluders.address, tables, widest_sine2, distance_m, openness
        )
    counts = [len(mesh.positions) for mesh in scene.meshes]
    return tuple(np.split(openness, np.cumsum(counts)[:-1])) if counts else ()


def _checked(cone_rad: float, distance_m: float) -> tuple[float, float]:
    """Return sin² of half the cone, and the distance as rays have it."""
    if not 0 < cone_rad <= math.pi:
        raise InputError(
            f"the cone must be above 0 and at most 180°, got {math.degrees(cone_rad):g}°"
        )
    if not distance_m > 0:
        raise InputError(f"the distance must be above 0, got {distance_m} m")
    return math.sin(0.5 * cone_rad) ** 2, min(distance_m, float(FAR_M))


@njit(cache=True, nogil=True, parallel=True)
def _look_around(
    functions: tuple[int, int],
    scene: int,
    tables: Tables,
    eye: Floats,
    directions: Floats,
    widest_sine2: float,
    distance_m: float,
    seen: Floats,
) -> None:  # pragma: no cover - compiled
    """Set A and whether anything was hit, (H, W, 2), for rays (H, W, 3) from the eye."""
    for row in prange(directions.shape[0]):
        hits, valid = hit_packet()
        rays, traced = packet()
        surface = np.zeros((FIELDS, PACKET), np.float32)
        turns_rad, openness = np.zeros(PACKET), np.zeros(PACKET, np.float32)
        for first in range(0, directions.shape[1], PACKET):
            for i in range(PACKET):
                valid[i] = -1
                for axis in range(3):
                    hits[axis, i] = eye[axis]
                    hits[4 + axis, i] = directions[row, first + i, axis]
            find_surfaces(functions[0], scene, tables, hits, valid, surface)
            if surface[HIT].max() == 0:
                continue
            for i in range(PACKET):
                turns_rad[i] = 2 * math.pi * _dither(row, first + i)
            _look(
                functions[1], scene, tables.ground, surface, RAYS, turns_rad, widest_sine2,
                distance_m, rays, traced, openness,
            )  # fmt: skip
            for i in range(PACKET):
                seen[row, first + i, 0] = openness[i]
                seen[row, first + i, 1] = surface[HIT, i]


@njit(cache=True, nogil=True, parallel=True)
def _look_from_vertices(
    function: int,
    scene: int,
    tables: Tables,
    widest_sine2: float,
    distance_m: float,
    openness: Floats,
) -> None:  # pragma: no cover - compiled
    """Set A of every vertex, (V,)."""
    count, offset_m = len(openness), np.float32(OFFSET) * tables.sphere[3]
    for part in prange((count + PACKET - 1) // PACKET):
        rays, traced = packet()
        surface = np.zeros((FIELDS, PACKET), np.float32)
        turns_rad, of_part = np.zeros(PACKET), np.zeros(PACKET, np.float32)
        here = min(PACKET, count - PACKET * part)
        for i in range(here):
            vertex = PACKET * part + i
            for axis in range(3):
                normal = tables.normals[vertex, axis]
                surface[NORMAL + axis, i] = surface[FACE_NORMAL + axis, i] = normal
                surface[axis, i] = tables.positions[vertex, axis] + offset_m * normal
            surface[HIT, i] = 1
            turns_rad[i] = 2 * math.pi * _dither(part, i)
        _look(
            function, scene, tables.ground, surface, VERTEX_RAYS, turns_rad, widest_sine2,
            distance_m, rays, traced, of_part,
        )  # fmt: skip
        openness[PACKET * part : PACKET * part + here] = of_part[:here]


@njit(nogil=True)
def _look(
    function: int,
    scene: int,
    ground: Floats,
    surface: Floats,
    ray_count: int,
    turns_rad: NDArray[np.float64],
    widest_sine2: float,
    distance_m: float,
    rays: Floats,
    traced: NDArray[np.int32],
    openness: Floats,
) -> None:  # pragma: no cover - compiled
    """Set A of a packet's surfaces, (PACKET,), each with the rays turned about its normal."""
    openness[:] = 0
    rays[:3] = surface[:3]
    for r in range(ray_count):
        for i in range(PACKET):
            sine2 = widest_sine2 * (r + 0.5) / ray_count
            x, y, z = _about(surface, i, sine2, r * _GOLDEN_ANGLE + turns_rad[i])
            rays[4, i], rays[5, i], rays[6, i], rays[8, i] = x, y, z, distance_m
            is_open = surface[HIT, i] > 0 and _is_open(surface, ground, i, x, y, z, distance_m)
            traced[i] = -np.int32(is_open)
        occluded16(function, traced.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        for i in range(PACKET):
            if traced[i] != 0 and rays[8, i] > 0:
                openness[i] += np.float32(1 / ray_count)


@njit(nogil=True)
def _is_open(
    surface: Floats, ground: Floats, i: int, x: float, y: float, z: float, distance_m: float
) -> bool:  # pragma: no cover - compiled
    """Whether a direction is above the face, and the ground is not in its way."""
    n = FACE_NORMAL
    above = surface[n, i] * x + surface[n + 1, i] * y + surface[n + 2, i] * z > 0
    height_m = surface[1, i] - ground[0]
    meets_ground = ground[1] > 0 and y < 0 and height_m < -y * distance_m
    return bool(above and not meets_ground)


@njit(nogil=True)
def _about(
    surface: Floats, i: int, sine2: float, turn_rad: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return the direction at an angle from the shading normal and a turn about it."""
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    across = math.sqrt(sine2)
    a, b, c = across * math.cos(turn_rad), across * math.sin(turn_rad), math.sqrt(1 - sine2)
    x, y, z = a * tx + b * bx + c * nx, a * ty + b * by + c * ny, a * tz + b * bz + c * nz
    return x, y, z


@njit(nogil=True)
def _dither(row: int, column: int) -> float:  # pragma: no cover - compiled
    """Return a number in [0, 1) far from its neighbours': Roberts' R2 lattice."""
    return (0.7548776662466927 * column + 0.5698402909980532 * row) % 1.0
