"""What the chart of renderers draws: three scenes, each hard in another way, and five maps.

Input  : sizes; files, if any are given.    Output : scenes with cameras, maps, by name.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from lighting.simulation.outdoors import outdoors
from lighting.simulation.sequences import SEQUENCES, frames
from lighting.simulation.truth import read_truth
from render.reference.digest import digest_of
from render.scenes.default_scene import default_scene, frame_meshes, sphere, torus
from render.scenes.mesh import load_meshes
from render.scenes.scene import Camera, Material, Mesh, Scene

MAP_ROWS = 256
_DIGITS = 16  # of digests, which are parts of names
_RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
_MATT = Material((0.7, 0.68, 0.6), specular=0.0)

View = tuple[Scene, Camera]


def chart_scenes(meshes: Sequence[Path], size_px: tuple[int, int]) -> dict[str, View]:
    """Return the scenes of mesh files by their names, or without any the three made ones.

    Those are a matt, a metal and a glossy object that float; slats on posts, whose shadows are
    stripes; and a heap of seventy balls and rings, 80,000 triangles. On a ground everything is
    matt: what mirrors would show the ground, which the reference, of direct light alone, has black.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    if meshes:
        return {str(path): frame_meshes(load_meshes(path).meshes, size_px) for path in meshes}
    objects, camera = default_scene(size_px)
    return {
        "objects": (replace(objects, ground=None), camera),
        "slats": _from_above(_slats(), size_px),
        "heap": _from_above(_heap(), size_px),
    }


def chart_maps(paths: Sequence[Path]) -> dict[str, EnvironmentMap]:
    """Return maps of files by name, or without any those of the bundled recordings and made ones.

    Made are a low sun, an overcast sky and a lamp in the dark. Where fishlight was installed
    without its recordings there are these alone.

    Raises
    ------
    InputError
        If a file cannot be read or holds no light above the horizon.
    """
    if paths:
        return {str(path): _read(path) for path in paths}
    bundled = {
        path.parent.name: read_truth(path).moments[0].true_map()
        for path in sorted(_RECORDINGS.glob("*/truth"))
    }
    *_, overcast = frames(SEQUENCES["cloud front"], MAP_ROWS, 2)
    lamp, _ = frames(SEQUENCES["one lamp for another"], MAP_ROWS, 2)
    return bundled | {
        "low sun": outdoors(MAP_ROWS),
        "overcast": overcast.truth,
        "lamp": lamp.truth,
    }


def view_digest(scene: Scene, camera: Camera) -> str:
    """Return what tells scenes and cameras apart by all that is in them."""
    return digest_of(scene, camera)[:_DIGITS]


def map_digest(environment: EnvironmentMap) -> str:
    """Return what tells maps apart by their light."""
    return digest_of(environment.radiance)[:_DIGITS]


def _read(path: Path) -> EnvironmentMap:
    environment, _ = read_environment(path)
    if not environment.radiance[: (environment.height + 1) // 2].any():
        raise InputError(f"{path}: there is no light above its horizon to render by")
    return environment


def _from_above(meshes: tuple[Mesh, ...], size_px: tuple[int, int]) -> View:
    """Return meshes on a ground seen from 35° above it, where their shadows are."""
    scene, camera = frame_meshes(meshes, size_px)
    distance_m = 0.85 * float(np.linalg.norm(camera.eye - camera.target))
    return scene, replace(camera, eye=camera.target + distance_m * np.array([0.3, 0.57, 0.76]))


def _slats() -> tuple[Mesh, ...]:
    """Return a roof of slats of 2 cm on four posts, and a ball below it."""
    slats = [_box((x, 0.9, -0.6), (x + 0.02, 1.0, 0.6)) for x in np.arange(-0.7, 0.7, 0.08)]
    posts = [_box((x, 0, z), (x + 0.06, 0.9, z + 0.06)) for x in (-0.7, 0.62) for z in (-0.5, 0.44)]
    return _joined([*slats, *posts]), sphere((0.1, 0.3, 0.0), 0.3, _MATT)


def _heap() -> tuple[Mesh, ...]:
    rng = np.random.default_rng(5)
    meshes = []
    for number in range(70):
        turn, away = rng.uniform(0, 2 * math.pi), 1.1 * math.sqrt(rng.uniform())
        radius_m = rng.uniform(0.08, 0.22)
        at = (away * math.sin(turn), rng.uniform(radius_m, 0.8), away * math.cos(turn))
        red, green, blue = rng.uniform(0.2, 0.9, 3)
        material = Material((red, green, blue), specular=0.0)
        if number % 3:
            meshes.append(sphere(at, radius_m, material, rings=16))
        else:
            meshes.append(torus(at, 0.75 * radius_m, 0.25 * radius_m, material, segments=45))
    return tuple(meshes)


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """Return a box between two corners, each face with vertices of its own."""
    corners = np.array([low, high])
    positions, normals = [], []
    for axis in range(3):
        for side in (0, 1):
            quad = np.empty((4, 3))
            quad[:, axis] = corners[side, axis]
            quad[:, (axis + 1) % 3] = corners[[0, 1, 1, 0], (axis + 1) % 3]
            quad[:, (axis + 2) % 3] = corners[[0, 0, 1, 1], (axis + 2) % 3]
            positions.append(quad if side else quad[::-1])  # counter-clockwise from outside
            normals.append(np.tile((2 * side - 1) * np.eye(3)[axis], (4, 1)))
    faces = np.concatenate([[[k, k + 1, k + 2], [k, k + 2, k + 3]] for k in range(0, 24, 4)])
    return Mesh(
        np.concatenate(positions).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
        faces.astype(np.int32),
        _MATT,
    )


def _joined(meshes: Iterable[Mesh]) -> Mesh:
    meshes = list(meshes)
    first = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.faces + np.int32(at) for mesh, at in zip(meshes, first, strict=True)]),
        meshes[0].material,
    )
