"""Pictures of a scene that stands still before a camera that stands still: only the light changes.

What each sample passes on from each of a few hundred fixed cells of the sky (and from each narrow
light) is traced once. A frame is then a product: transport × light, at any number of lights.

Input  : a scene, a camera and LightSets.    Output : linear radiance, in the lights' scale.
Cost   : tracing, seconds; a frame, see tests/benchmarks/render.py; memory, a byte per sample and
         cell, and up to 700 for a sample that mirrors. A narrow light that moves costs its rays.
Fails  : light within a cell comes from all of it, so shadows of lights that are no narrower blur by
         up to a cell (9° across). What mirrors shows the map, and no other object (gloss.py,
         tests/limits/test_render_baked_gloss.py). The floor of a room lights objects as if it lay
         under an even sky, whatever shadows single lights cast on it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.direction_cells import disc_points, map_over_cells
from render.baked.gloss import ROUGH_ALPHA, add_reflections, trace_gloss
from render.baked.narrow import NarrowLights
from render.baked.sky_cells import SkyCells, luminance_of_all
from render.baked.surface_samples import mirror_tint, surface_samples
from render.baked.transport import Colours, NarrowTransport, Transport
from render.baked.transport_kernel import TILE, place, trace_transport
from render.lights.discs import Discs
from render.lights.light_map import map_of_lights
from render.lights.map_pyramid import map_pyramid
from render.lights.peaks import without_peaks
from render.moving.shared_rays import DEFAULT_EFFORT, SharedRays
from render.owner import Owner
from render.rays.background import (
    look_through,
    look_up,
    map_coordinates,
    picture_rays,
    seen_ground,
    with_ground,
)
from render.rays.embree import occluded16_address
from render.rays.floor_light import add_floor_light, add_lit, open_floor
from render.rays.surface_rows import empty_surfaces, in_picture
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Scene

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]

_DISC_RAYS = (4, 16)
_DISC_RAYS_PER_RAD = 140.0  # 4 for the sun, 16 from a radius of 5° on
_LEAST_ALPHA = 0.01
_FLOOR_RAYS = 128
_CELL_ROWS = 128


class BakedRenderer(Owner):
    """Draws one scene from one camera under any light sets, from transport traced beforehand.

    Owns Embree's memory: use it as a context manager.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    samples_per_axis : int
        Each pixel is the mean of its square of samples.
    """

    def __init__(self, scene: Scene, camera: Camera, samples_per_axis: int = 1) -> None:
        self._scene = scene
        self._camera = camera
        self._samples_per_axis = samples_per_axis
        width, height = (samples_per_axis * length for length in camera.size_px)
        self._shape = height, width
        self._traced = TracedScene(scene)
        self._surfaces = empty_surfaces((width, height))
        self._traced.find_surfaces(camera, (width, height), self._surfaces)
        seen = surface_samples(self._traced, camera, in_picture(self._surfaces, (width, height)))
        self._samples, self._surface = seen.samples, seen.surface
        mirroring = np.flatnonzero(self._surface[:, 12].max(axis=1) > 0)
        self._colours = Colours(seen.matt, mirroring, mirror_tint(seen.f0[mirroring]))
        self._cells = SkyCells(scene)
        self._sky = self._trace_sky()
        self._gloss = trace_gloss(
            occluded16_address(),
            self._traced.address,
            self._traced.sphere,
            self._surface[mirroring],
            seen.f0[mirroring],
            seen.f90[mirroring],
            scene.ground is not None,
        )
        self._narrow, self._rays = NarrowLights(), SharedRays(DEFAULT_EFFORT)

        self._of_floor: tuple[NDArray[np.intp], _FLOATS] | None = None
        rays = picture_rays(camera, (width, height)).reshape(-1, 3)
        self._unseen, self._ground = np.flatnonzero(~seen.hit), np.flatnonzero(seen.ground)
        self._unseen_at = map_coordinates(rays[self._unseen])
        self._ground_at = map_coordinates(rays[self._ground])

    def release(self) -> None:
        """Free Embree's memory."""
        self._traced.release()

    def render(
        self,
        lights: LightSet,
        background: EnvironmentMap | None = None,
        *,
        through_ground: bool = False,
    ) -> NDArray[np.float32]:
        """Return the picture under `lights`, as `Renderer.render` does.

        Mirrors show the background too; without one, the lights. With `through_ground` the ground
        shows what the background does there, where that was seen, carries shadows, and lights what
        faces it: objects stand in the room.
        """
        light, narrow = self._cells.split(lights)
        ground = self._cells.unshaded(light, narrow)
        floor = None
        if through_ground and background is not None:
            floor = seen_ground(background, ground)
            background = with_ground(background, floor)
        picture = np.zeros((len(self._surface), 3, TILE), np.float32)
        of_map = np.zeros_like(light)
        if len(self._colours.mirroring):
            shown = map_of_lights(lights, _CELL_ROWS) if background is None else background
            of_map, narrow = self._reflect(
                shown, narrow, None if through_ground else ground, picture
            )
        self._sky.add(light, of_map, picture)
        traced, moving = self._narrow.follow(narrow, self._trace_light)
        still = narrow.taken(~moving)
        self._colours.add(traced, still.irradiance, still.mirrored, picture)
        out = self._placed(picture)
        if moving.any():
            self._add_moving(narrow.taken(moving), luminance_of_all(light, narrow), out)
        if floor is not None and self._scene.ground is not None:
            add_lit(*self.trace_floor(), floor, out.reshape(-1, 4))
        return self._assembled(out, background, ground if through_ground else None)

    def _reflect(
        self,
        environment: EnvironmentMap,
        narrow: Discs,
        ground: NDArray[np.float32] | None,
        picture: NDArray[np.float32],
    ) -> tuple[Array, Discs]:
        """Add what smooth samples mirror of a map without its peaks to `picture`, and the ground.

        Returns ∫L dω of each cell, (D, 3), which rough ones mirror, and the lights' peaks.
        """
        rest, narrow = without_peaks(environment, narrow)
        pyramid = map_pyramid(rest)
        add_reflections(self._gloss, pyramid, ground, self._colours.mirroring, picture)
        coarse = pyramid.coarse(_CELL_ROWS)
        return map_over_cells(coarse, upper_only=self._scene.ground is not None), narrow

    def _trace_sky(self) -> Transport:
        """Trace the transport of the sky's cells."""
        colours = self._colours
        is_rough = self._surface[colours.mirroring, 12].max(axis=1) >= ROUGH_ALPHA**2
        rough = colours.mirroring[is_rough]
        matt, matt_step, mirror, mirror_step = self._trace(
            self._cells.rays, rough, from_alpha=ROUGH_ALPHA
        )
        matt_scale = colours.matt * matt_step[:, None]
        return Transport(
            matt, matt_scale, rough, mirror, colours.mirror[is_rough] * mirror_step[:, None]
        )

    def _trace_light(self, direction: Array, radius_rad: float) -> NarrowTransport:
        """Trace the transport of a narrow light."""
        rays = int(np.clip(_DISC_RAYS[0] + _DISC_RAYS_PER_RAD * radius_rad, *_DISC_RAYS))
        apart = max(radius_rad / math.sqrt(rays), _LEAST_ALPHA)
        points = disc_points(direction, radius_rad, rays)[None]
        matt, matt_step, mirror, mirror_step = self._trace(
            points, self._colours.mirroring, least_alpha=apart
        )
        return NarrowTransport(matt[:, 0] * matt_step, mirror[:, 0] * mirror_step)

    def trace_floor(self) -> tuple[NDArray[np.intp], _FLOATS]:
        """Return the samples (M,) that reflect a floor below an even sky, their shares (M, 3).

        They are traced once; else, the first picture through the ground takes so much longer.
        """
        if self._of_floor is not None:
            return self._of_floor
        lit = np.zeros((*self._shape, 4), np.float32)
        one = np.ones(3, np.float32)
        shade = open_floor(self._traced)
        add_floor_light(self._traced, self._surfaces, one, shade, lit, _FLOOR_RAYS)
        share = lit.reshape(-1, 4)[:, :3]
        samples = np.flatnonzero(share.any(axis=1))
        self._of_floor = samples, share[samples]
        return self._of_floor

    def _trace(
        self,
        points: Array,
        mirroring: NDArray[np.intp],
        *,
        from_alpha: float = 0.0,
        least_alpha: float = 0.0,
    ) -> tuple[NDArray[np.uint8], _FLOATS, NDArray[np.uint8], _FLOATS]:
        """Return the transport of cells, each with points (D, S, 3), as `trace_transport` does.

        Surfaces mirror from a GGX width on, and as if they were no smoother than another.
        """
        tiles, count = len(self._surface), len(points)
        mirror_row = np.full(tiles, -1)
        mirror_row[mirroring] = np.arange(len(mirroring))
        matt = np.zeros((tiles, count, TILE), np.uint8)
        mirror = np.zeros((len(mirroring), count, TILE), np.uint8)
        matt_step = np.zeros((tiles, TILE), np.float32)
        mirror_step = np.zeros((len(mirroring), TILE), np.float32)
        trace_transport(
            occluded16_address(),
            self._traced.address,
            self._traced.sphere,
            self._surface,
            points.astype(np.float32),
            from_alpha**2,
            least_alpha**2,
            mirror_row,
            matt,
            matt_step,
            mirror,
            mirror_step,
        )
        return matt, matt_step, mirror, mirror_step

    def _placed(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return samples (tiles, 3, TILE) as a picture (H, W, 4)."""
        out = np.zeros((*self._shape, 4), np.float32)
        place(picture, self._samples, out.reshape(-1, 4))
        return out

    def _add_moving(self, lights: Discs, power: float, out: NDArray[np.float32]) -> None:
        """Add lights that are not worth tracing to a picture (H, W, 4), by rays of this one."""
        pixel_rad = 2 * self._camera.half_extent()[1] / self._shape[0]
        self._rays.add(
            self._traced, self._surfaces, self._camera.eye, pixel_rad, lights, power, out
        )

    def _assembled(
        self,
        out: NDArray[np.float32],
        background: EnvironmentMap | None,
        unshaded: NDArray[np.float32] | None,
    ) -> NDArray[np.float32]:
        height, width = self._shape
        if background is not None:
            flat, radiance = out.reshape(-1, 4), np.ascontiguousarray(background.radiance)
            look_up(radiance, self._unseen_at, self._unseen, flat)
            if unshaded is not None:
                look_through(radiance, self._ground_at, self._ground, unshaded, flat)
        n = self._samples_per_axis
        samples = out.reshape(height // n, n, width // n, n, 4)
        return samples[:, 0, :, 0] if n == 1 else samples.mean(axis=(1, 3), dtype=np.float32)
