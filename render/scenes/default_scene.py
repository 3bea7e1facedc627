"""The scene that is rendered when no mesh is given, and the view of one that is.

Three objects on a neutral ground, each of which shows one thing about the lights: a matt white
sphere their diffuse sum, a metal sphere where they stand, and a ring their shadows.
"""

import math

import numpy as np
from numpy.typing import NDArray

from render.scenes.casters import gather_casters
from render.scenes.scene import Camera, Ground, Material, Mesh, Scene

FRONT_AZIMUTH_RAD = math.radians(20)
"""Where the camera stands before a mesh, whose front is +Z as in glTF: a little to its left."""
GROUND_REFLECTANCE = (0.5, 0.5, 0.5)
GROUND_EXTENT = 1000.0
"""Radius of the ground over that of the objects: its edge is 0.1° below the horizon."""


def sphere(
    centre: tuple[float, float, float], radius_m: float, material: Material, rings: int = 48
) -> Mesh:
    """Return a sphere of `rings` × 2 `rings` quads, vertices on the sphere, exact normals."""
    theta, phi = np.meshgrid(np.linspace(0.0, math.pi, rings + 1), _full_turn(2 * rings))
    level = np.sin(theta)
    level[:, -1] = 0.0  # sin π is not, in floating point, and the pole would be a hole
    normals = np.stack([level * np.sin(phi), np.cos(theta), level * np.cos(phi)], axis=-1)
    faces = _grid_faces(2 * rings, rings)
    return _mesh(np.asarray(centre) + radius_m * normals, normals, faces, material)


def torus(
    centre: tuple[float, float, float],
    radius_m: float,
    tube_radius_m: float,
    material: Material,
    segments: int = 96,
) -> Mesh:
    """Return a torus that stands upright, its axis along +Z, with exact normals."""
    around, tube = np.meshgrid(_full_turn(segments), _full_turn(segments // 3), indexing="ij")
    outward = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=-1)
    normals = np.cos(tube)[..., None] * outward + np.sin(tube)[..., None] * [0.0, 0.0, 1.0]
    positions = np.asarray(centre) + radius_m * outward + tube_radius_m * normals
    return _mesh(positions, normals, _grid_faces(segments, segments // 3), material)


def default_scene(size_px: tuple[int, int] = (640, 480)) -> tuple[Scene, Camera]:
    """Return the default scene and its camera.

    The camera looks along +Z as a level fisheye does, so what that saw stands behind the objects.
    """
    white = Material((0.8, 0.8, 0.8), roughness=1.0, specular=0.0)
    metal = Material((0.95, 0.93, 0.88), roughness=0.35, metalness=1.0)
    clay = Material((0.55, 0.22, 0.12), roughness=0.5)
    meshes = (
        sphere((0.62, 0.5, -0.25), 0.5, white),
        sphere((-0.62, 0.4, -0.45), 0.4, metal),
        torus((-0.1, 0.75, 0.65), 0.6, 0.15, clay),
    )
    return frame_meshes(meshes, size_px, azimuth_rad=math.pi + FRONT_AZIMUTH_RAD)


def frame_meshes(
    meshes: tuple[Mesh, ...],
    size_px: tuple[int, int] = (640, 480),
    azimuth_rad: float = FRONT_AZIMUTH_RAD,
) -> tuple[Scene, Camera]:
    """Return a scene of `meshes` on a ground that touches their lowest point, and a camera.

    The camera stands at `azimuth_rad` from +Z toward +X and looks down on their bounding sphere by
    12°, from the distance at which the sphere fills the picture up to a margin of 10 %. Nothing is
    moved or scaled: distant lights know no scale.
    """
    lowest = min(float(mesh.positions[:, 1].min()) for mesh in meshes)
    casters = gather_casters(meshes)
    centre, radius_m = casters.centre, casters.radius_m
    scene = Scene(meshes, Ground(lowest, GROUND_REFLECTANCE, GROUND_EXTENT * radius_m))
    view = _direction(azimuth_rad, elevation_rad=math.radians(12))
    fov_rad = math.radians(35)
    narrow = math.atan(math.tan(0.5 * fov_rad) * min(1.0, size_px[0] / size_px[1]))
    distance_m = 1.1 * radius_m / math.sin(narrow)
    return scene, Camera(centre + distance_m * view, centre, fov_rad, size_px)


def _direction(azimuth_rad: float, elevation_rad: float) -> NDArray[np.float64]:
    level = math.cos(elevation_rad)
    return np.array(
        [level * math.sin(azimuth_rad), math.sin(elevation_rad), level * math.cos(azimuth_rad)]
    )


def _full_turn(steps: int) -> NDArray[np.float64]:
    """Angles of a full turn, (steps + 1,); the last is the first, so that the seam closes."""
    return 2 * math.pi * (np.arange(steps + 1) % steps) / steps


def _grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Triangles (2 rows columns, 3) between the vertices of a (rows + 1, columns + 1) grid."""
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    quads = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2)
    return quads.reshape(-1, 3).astype(np.int32)


def _mesh(
    positions: NDArray[np.float64],
    normals: NDArray[np.float64],
    faces: NDArray[np.int32],
    material: Material,
) -> Mesh:
    return Mesh(
        positions.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        faces,
        material,
    )
