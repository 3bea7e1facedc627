"""Pictures of a scene that stands still, from a camera that moves, under light that moves.

What points all over the scene pass on of the sky's cells is traced once. When the light changes
their irradiance is a product, transport × light; a picture interpolates it where rays find
surfaces. Narrow lights get rays of each picture, and so does what mirrors.

Input  : a scene, a camera and LightSets.    Output : linear radiance, in the lights' scale.
Cost   : tracing, a second per 30,000 points; a byte per point and cell; a picture, see
         tests/benchmarks/render.py.
Fails  : as in surface_points.py, shared_rays.py and reflected_map.py.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.between_points import add_irradiance
from render.baked.sky_cells import SkyCells, luminance_of_all
from render.baked.surface_points import SurfacePoints, surface_points
from render.baked.transport import Transport
from render.baked.transport_kernel import TILE, trace_transport
from render.lights.light_map import map_of_lights
from render.lights.map_pyramid import map_pyramid
from render.lights.peaks import without_peaks
from render.moving.reflected_map import ReflectedMap
from render.moving.shared_rays import DEFAULT_EFFORT, SharedRays
from render.moving.surroundings import mark_surfaces, show_map
from render.owner import Owner
from render.rays.background import seen_ground, with_ground
from render.rays.embree import occluded16_address
from render.rays.floor_light import add_floor_light, open_floor
from render.rays.surface_rows import FIELDS, empty_surfaces
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Scene

Array = NDArray[np.float64]

_MAP_ROWS = 128
_WIDEST = 0.5  # of a cell: rays for every picture cost more than what a wider light loses in cells


class RoamingRenderer(Owner):
    """Draws one scene from any camera under any light sets.

    Owns Embree's memory: use it as a context manager, from one thread.
    """

    def __init__(self, scene: Scene) -> None:
        self._traced = TracedScene(scene)
        self._points = surface_points(self._traced.geometry, scene.ground)
        self._cells = SkyCells(scene, _WIDEST)
        self._transport = trace_points(self._traced, self._points, self._cells.rays)
        self._rays = SharedRays(DEFAULT_EFFORT)
        self._mirrors = ReflectedMap()
        self._surfaces = np.zeros((0, 0, 0, 0), np.float32)
        self._floor_shade: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._light = np.zeros((0, 3))
        self._irradiance = np.zeros((0, 3), np.float32)

    def release(self) -> None:
        """Free Embree's memory."""
        self._traced.release()

    def render(
        self,
        camera: Camera,
        lights: LightSet,
        background: EnvironmentMap | None = None,
        *,
        through_ground: bool = False,
    ) -> NDArray[np.float32]:
        """Return the picture from `camera`, as `BakedRenderer.render` does."""
        width, height = camera.size_px
        self._find_surfaces(camera)
        picture = np.empty((height, width, 4), np.float32)
        mark_surfaces(self._surfaces, picture)
        light, narrow = self._cells.split(lights)
        self._add_sky(light, picture)
        ground = self._cells.unshaded(light, narrow)
        floor = None
        if through_ground and background is not None:
            floor = seen_ground(background, ground)
            background = with_ground(background, floor)
        shown = map_of_lights(lights, _MAP_ROWS) if background is None else background
        rest, narrow = without_peaks(shown, narrow)
        self._mirrors.add(
            self._traced, self._surfaces, camera.eye, map_pyramid(rest),
            None if through_ground else ground, picture, rough_alpha=np.inf,
        )  # fmt: skip
        if len(narrow):
            pixel_rad = 2 * camera.half_extent()[1] / height
            self._rays.add(
                self._traced, self._surfaces, camera.eye, pixel_rad, narrow,
                luminance_of_all(light, narrow), picture,
            )  # fmt: skip
        if floor is not None and self._traced.scene.ground is not None:
            self._floor_shade = self._floor_shade or open_floor(self._traced)
            add_floor_light(
                self._traced, self._surfaces, floor, self._floor_shade, picture,
                DEFAULT_EFFORT.floor_rays,
            )  # fmt: skip
        if background is not None:
            show_map(
                self._surfaces, camera.eye, background.radiance,
                ground if through_ground else None, picture,
            )  # fmt: skip
        return picture

    def _find_surfaces(self, camera: Camera) -> None:
        surfaces = empty_surfaces(camera.size_px, FIELDS + 3)
        if self._surfaces.shape != surfaces.shape:
            self._surfaces = surfaces
        self._traced.find_surfaces(camera, camera.size_px, self._surfaces)

    def _add_sky(self, light: Array, picture: NDArray[np.float32]) -> None:
        """Add what surfaces reflect evenly of ∫L dω of each cell, (D, 3)."""
        if not light.any():
            return
        if not np.array_equal(light, self._light):
            received = np.zeros(self._transport.matt_scale.shape, np.float32)
            self._transport.add(light, np.zeros_like(light), received)
            self._irradiance = np.ascontiguousarray(received.swapaxes(1, 2)).reshape(-1, 3)
            self._light = light
        points = self._points
        upward = self._cells.received_upward(light).astype(np.float32)
        add_irradiance(
            self._surfaces, points.corners, points.steps, points.grids, points.ground_start,
            self._irradiance, upward, picture,
        )  # fmt: skip


def trace_points(traced: TracedScene, points: SurfacePoints, rays: Array) -> Transport:
    """Return what points receive of cells, in tiles; the last is filled up with others' points."""
    tiles = -(-len(points.positions) // TILE)
    which = np.resize(np.arange(len(points.positions)), tiles * TILE)
    positions, normals = points.positions[which], points.normals[which]
    surface = np.zeros((tiles, 14, TILE), np.float32)
    origins = positions + np.float32(traced.offset_m) * normals
    for first, values in ((0, origins), (3, normals), (6, normals), (9, normals)):
        surface[:, first : first + 3] = values.reshape(tiles, TILE, 3).swapaxes(1, 2)
    surface[:, 12] = -1  # nothing is mirrored
    matt = np.zeros((tiles, len(rays), TILE), np.uint8)
    step = np.zeros((tiles, TILE), np.float32)
    none, no_tile = np.zeros((0, len(rays), TILE), np.uint8), np.full(tiles, -1)
    trace_transport(
        occluded16_address(), traced.address, traced.sphere, surface, rays.astype(np.float32),
        0.0, 0.0, no_tile, matt, step, none, np.zeros((0, TILE), np.float32),
    )  # fmt: skip
    scale = np.repeat(step[:, None], 3, axis=1)
    return Transport(matt, scale, np.zeros(0, np.intp), none, scale[:0])
