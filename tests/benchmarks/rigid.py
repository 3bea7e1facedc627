"""An object that only turns: what kept transport, or kept visibility, would save of a picture.

`MovingRenderer` traces everything anew. This bounds what it could save by knowing that an object
moved as one piece, with the camera and all else standing (ARCHITECTURE.md, D39):

- its own pixels cost nothing, as if its own transport, in its own coordinates, were free;
- only shadow rays toward it are traced, as if all others were kept, of lights that stand still;
- a matt one that stands alone is lit from its own transport, and the ground by shadow rays. What
  mirrors needs rays to each light all the same, and of what is read from files all does.

640×480, 64 lights and a fill, 2° from picture to picture. CPU time of both cores, as a median over
the pictures, which the ways draw in turn; accuracy is the relative RMSE against 16 of 256 points of
every light from every pixel.
"""

import math
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.baked.between_points import add_irradiance
from render.baked.roaming import trace_points
from render.baked.sky_cells import SkyCells
from render.baked.surface_points import surface_points
from render.lights.discs import Discs
from render.lights.dome import dome_lights
from render.lights.reaching_lights import reaching_lights
from render.moving.shared_rays import DEFAULT_EFFORT, Effort, SharedRays
from render.moving.surroundings import mark_surfaces
from render.owner import Owner
from render.rays.surface_rows import DULL, FIELDS, KIND, NOTHING, TRIANGLE, empty_surfaces
from render.rays.traced_scene import TracedScene
from render.scenes.default_scene import FRONT_AZIMUTH_RAD, default_scene, frame_meshes
from render.scenes.scene import Camera, Material, Mesh, Scene
from tests.benchmarks.render import light_cases
from tests.render.light_sets import uniform_fill

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]

RING = 2  # of the default scene's meshes
STEP_RAD = math.radians(2)
COMPLETE = ("rays", "its own transport, and rays")
"""Ways that lack nothing of the picture."""
WIDEST = 0.5  # of a cell, as in roaming.py
EXACT = Effort(key_lights=128, key_share=0.0, key_rays=16, is_sparing=False, soft_rad=math.inf)


def run(repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    scene, camera = default_scene()
    ring = replace(scene.meshes[RING], material=Material((0.6, 0.5, 0.4), specular=0.0))
    alone, near = frame_meshes((ring,), azimuth_rad=math.pi + FRONT_AZIMUTH_RAD)
    turns = max(repeats // 2, 2)
    with Turning(scene, RING, camera) as among_others, Turning(alone, 0, near) as matt:
        return [
            *_rows("one of three objects turns", among_others, turns),
            *_rows("a matt object turns alone", matt, turns),
        ]


def _rows(case: str, turning: "Turning", turns: int) -> list[dict[str, Any]]:
    ways: dict[str, Callable[[LightSet], tuple[_FLOATS, float]]] = {
        "rays": turning.by_rays,
        "rays, its own pixels free": turning.without_its_pixels,
        "rays, only those toward it": turning.by_rays_toward_it,
    }
    if len(turning.scene.meshes) == 1:
        ways["its own transport, and rays"] = turning.by_own_transport
    rows = []
    for name, lights in light_cases().items():
        lights = replace(lights, fill=uniform_fill(0.3))
        spent_ms: dict[str, list[float]] = {way: [] for way in ways}
        pictures = {}
        for turn in range(turns + 1):
            turning.turn(turn * STEP_RAD)
            for way, draw in ways.items():
                pictures[way], spent_s = draw(lights)
                spent_ms[way].append(1e3 * spent_s)
        truth, _ = turning.exact(lights)
        hit = truth[..., 3] > 0
        power = np.mean(truth[hit, :3] ** 2)
        for way, times in spent_ms.items():
            ms, by_rays_ms = (statistics.median(each[1:]) for each in (times, spent_ms["rays"]))
            error = math.sqrt(np.mean((pictures[way] - truth)[hit, :3] ** 2) / power)
            rows.append(
                {
                    "stage": "rigid",
                    "case": f"{case}, {name} and a fill, CPU time",
                    "system": way,
                    "ms": ms,
                    "ratio": by_rays_ms / ms,
                    "accuracy": {"rel. RMSE": error} if way in COMPLETE else {},
                }
            )
    return rows


class Turning(Owner):
    """A scene in which a mesh turns about the vertical through its middle.

    Each way to draw it returns the picture, and the CPU time in s that it is worth.
    """

    def __init__(self, scene: Scene, mesh: int, camera: Camera) -> None:
        self.scene, self._mesh, self._camera = scene, mesh, camera
        self._traced = TracedScene(scene)
        width, height = camera.size_px
        self._surfaces = empty_surfaces((width, height), FIELDS + 3)
        self._pixel_rad = 2 * camera.half_extent()[1] / height
        self._every, self._narrow = SharedRays(DEFAULT_EFFORT), SharedRays(DEFAULT_EFFORT)
        self._cells = SkyCells(scene, WIDEST)
        self._angle_rad = 0.0
        own = TracedScene(Scene((scene.meshes[mesh],), None))
        self._sphere = own.sphere
        self._points = surface_points(own.geometry, None)
        self._transport = trace_points(own, self._points, self._cells.rays)
        own.release()

    def release(self) -> None:
        """Free Embree's memory."""
        self._traced.release()

    def turn(self, angle_rad: float) -> None:
        """Turn the mesh to an angle from where it was at first."""
        self._angle_rad = angle_rad
        meshes = list(self.scene.meshes)
        meshes[self._mesh] = turned(meshes[self._mesh], angle_rad)
        self._traced.move(replace(self.scene, meshes=tuple(meshes)))

    def by_rays(self, lights: LightSet) -> tuple[_FLOATS, float]:
        """Draw as `MovingRenderer` does."""
        start = time.process_time()
        picture = self._found()
        self._add(self._every, self._discs(lights), picture)
        return picture, time.process_time() - start

    def exact(self, lights: LightSet) -> tuple[_FLOATS, float]:
        """Draw with every light from every pixel."""
        start = time.process_time()
        picture = self._found()
        self._add(SharedRays(EXACT), self._discs(lights), picture)
        return picture, time.process_time() - start

    def without_its_pixels(self, lights: LightSet) -> tuple[_FLOATS, float]:
        """Leave the mesh black, and yet let it cast its shadow."""
        start = time.process_time()
        picture = self._found()
        spent_s = time.process_time() - start
        with self._shown(~self._is_own()):
            start = time.process_time()
            self._add(self._every, self._discs(lights), picture)
            return picture, spent_s + time.process_time() - start

    def by_rays_toward_it(self, lights: LightSet) -> tuple[_FLOATS, float]:
        """Leave out the shadows in which the mesh has no part."""
        everything = self._traced.sphere
        start = time.process_time()
        picture = self._found()
        self._traced.sphere = self._sphere
        self._add(self._every, self._discs(lights), picture)
        self._traced.sphere = everything
        return picture, time.process_time() - start

    def by_own_transport(self, lights: LightSet) -> tuple[_FLOATS, float]:
        """Light the only mesh from its own transport; narrow lights and the ground take rays.

        A turn about the vertical leaves the sky's cells, and a uniform fill, above the ground.
        """
        start = time.process_time()
        picture = self._found()
        seen_from_it = replace(lights, directions=lights.directions @ upright(self._angle_rad))
        light, _ = self._cells.split(seen_from_it)
        received = np.zeros(self._transport.matt_scale.shape, np.float32)
        self._transport.add(light, np.zeros_like(light), received)
        irradiance = np.ascontiguousarray(received.swapaxes(1, 2)).reshape(-1, 3)
        points, none = self._points, np.zeros(3, np.float32)
        add_irradiance(
            self._surfaces, points.corners, points.steps, points.grids, points.ground_start,
            irradiance, none, picture,
        )  # fmt: skip
        _, narrow = self._cells.split(lights)
        is_own = self._surfaces[:, :, KIND] >= DULL
        with self._shown(~is_own):
            self._add(self._every, self._discs(lights), picture)
        if len(narrow):
            with self._shown(is_own):
                self._add(self._narrow, narrow, picture)
        return picture, time.process_time() - start

    def _found(self) -> _FLOATS:
        """Find what is seen; return a black picture of it."""
        width, height = self._camera.size_px
        self._traced.find_surfaces(self._camera, (width, height), self._surfaces)
        picture = np.empty((height, width, 4), np.float32)
        mark_surfaces(self._surfaces, picture)
        return picture

    def _is_own(self) -> NDArray[np.bool_]:
        """Return which pixels show the mesh, (rows, LANES, columns)."""
        triangles = self._surfaces[:, :, TRIANGLE].view(np.int32)
        is_own = self._traced.geometry.mesh_of_face[np.maximum(triangles, 0)] == self._mesh
        is_seen: NDArray[np.bool_] = self._surfaces[:, :, KIND] >= DULL
        return is_own & is_seen

    @contextmanager
    def _shown(self, which: NDArray[np.bool_]) -> Iterator[None]:
        """Let only some pixels show anything."""
        kinds = self._surfaces[:, :, KIND]
        every = kinds.copy()
        kinds[~which] = NOTHING
        yield
        kinds[:] = every

    def _add(self, rays: SharedRays, lights: Discs, picture: _FLOATS) -> None:
        power = float(lights.irradiance.sum(axis=0) @ LUMINANCE_WEIGHTS)
        rays.add(
            self._traced, self._surfaces, self._camera.eye, self._pixel_rad, lights, power, picture
        )

    def _discs(self, lights: LightSet) -> Discs:
        parts = reaching_lights(lights, self.scene), dome_lights(lights.fill, upper_only=True)
        directions, irradiance, radius_rad = (
            np.concatenate(each) for each in zip(*parts, strict=True)
        )
        return Discs(directions, irradiance, radius_rad, irradiance)


def upright(angle_rad: float) -> Array:
    """Return the turn about +Y, (3, 3)."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def turned(mesh: Mesh, angle_rad: float) -> Mesh:
    """Return a mesh turned about the vertical through its middle."""
    turn, middle = upright(angle_rad).T, mesh.positions.mean(axis=0, dtype=np.float64)
    positions = (mesh.positions - middle) @ turn + middle
    return replace(
        mesh,
        positions=positions.astype(np.float32),
        normals=(mesh.normals @ turn).astype(np.float32),
    )
