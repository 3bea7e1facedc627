"""Pictures of a scene in which everything may move: objects, camera and lights. No OpenGL.

Rays find what is seen, what hides the lights from it, and what smooth surfaces mirror of the map.

Input  : a scene, a camera and LightSets.    Output : linear radiance, in the lights' scale.
Cost   : see tests/benchmarks/render.py, CPU time of both cores, everything new; nothing is kept but
         the triangles' hierarchy, which takes 2 ms per 70,000 triangles when they move.
Fails  : as in shared_rays.py and reflected_map.py. One sample per pixel may miss what is narrower.
         The light of a fill comes from a dome of discs (dome.py). Rough surfaces mirror the lights
         and not the map they stand for.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from render.lights.all_lights import all_lights, unshaded_ground
from render.lights.discs import Discs
from render.lights.map_pyramid import map_pyramid
from render.lights.peaks import ROUGH_ALPHA, without_peaks
from render.moving.reflected_map import ReflectedMap
from render.moving.shared_rays import DEFAULT_EFFORT, Effort, SharedRays
from render.moving.surroundings import mark_surfaces, show_map
from render.owner import Owner
from render.rays.background import seen_ground, with_ground
from render.rays.floor_light import FEW_CELLS, add_floor_light, open_floor
from render.rays.surface_rows import empty_surfaces
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Scene

Array = NDArray[np.float64]


class MovingRenderer(Owner):
    """Draws a scene from a camera under any light sets; all three may change from call to call.

    Owns Embree's memory: use it as a context manager, from one thread.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    samples_per_axis : int
        Each pixel is the mean of its square of samples.
    effort : Effort
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        samples_per_axis: int = 1,
        effort: Effort = DEFAULT_EFFORT,
    ) -> None:
        self._samples_per_axis = samples_per_axis
        self._traced = TracedScene(scene)
        self._rays = SharedRays(effort)
        self._mirrors = ReflectedMap()
        self._floor_rays = effort.floor_rays
        self._set_camera(camera)

    def release(self) -> None:
        """Free Embree's memory."""
        self._traced.release()

    def move(self, scene: Scene | None = None, camera: Camera | None = None) -> None:
        """Draw another scene, or the same one from another camera, from now on.

        Meshes may move, change shape, come and go; materials that stay the same objects are not
        read again.
        """
        if scene is not None:
            self._traced.move(scene)
        if camera is not None:
            self._set_camera(camera)

    def render(
        self,
        lights: LightSet,
        background: EnvironmentMap | None = None,
        *,
        through_ground: bool = False,
    ) -> NDArray[np.float32]:
        """Return the picture under `lights`, as `BakedRenderer.render` does."""
        self._traced.find_surfaces(self._camera, self._size_px, self._surfaces)
        width, height = self._size_px
        picture = np.empty((height, width, 4), np.float32)
        mark_surfaces(self._surfaces, picture)
        discs = self._discs(lights)
        ground = unshaded_ground(
            self._traced.scene, discs.directions, discs.irradiance, discs.radius_rad
        )
        floor = None
        if background is not None and through_ground:
            floor = seen_ground(background, ground)
            background = with_ground(background, floor)
        if background is not None:
            rest, discs = without_peaks(background, discs)
            self._mirrors.add(
                self._traced, self._surfaces, self._camera.eye, map_pyramid(rest),
                None if through_ground else ground, picture,
            )  # fmt: skip
        power = float(discs.irradiance.sum(axis=0) @ LUMINANCE_WEIGHTS)
        pixel_rad = 2 * self._camera.half_extent()[1] / height
        self._rays.add(
            self._traced, self._surfaces, self._camera.eye, pixel_rad, discs, power, picture,
            rough_alpha2=ROUGH_ALPHA**2,
        )  # fmt: skip
        if floor is not None and self._traced.scene.ground is not None and self._floor_rays:
            shade = open_floor(self._traced, FEW_CELLS)
            add_floor_light(self._traced, self._surfaces, floor, shade, picture, self._floor_rays)
        if background is not None:
            show_map(
                self._surfaces, self._camera.eye, background.radiance,
                ground if through_ground else None, picture,
            )  # fmt: skip
        n = self._samples_per_axis
        samples = picture.reshape(height // n, n, width // n, n, 4)
        return picture if n == 1 else samples.mean(axis=(1, 3), dtype=np.float32)

    def _set_camera(self, camera: Camera) -> None:
        width, height = (self._samples_per_axis * length for length in camera.size_px)
        self._camera = camera
        self._size_px = width, height
        surfaces = empty_surfaces(self._size_px)
        if getattr(self, "_surfaces", surfaces[:0]).shape != surfaces.shape:
            self._surfaces = surfaces

    def _discs(self, lights: LightSet) -> Discs:
        """Return the lights that reach the scene, a fill's dome among them."""
        directions, irradiance, radius_rad = all_lights(lights, self._traced.scene)
        return Discs(directions, irradiance, radius_rad, irradiance)
