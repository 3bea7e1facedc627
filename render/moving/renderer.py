"""Pictures of a scene in which everything may move: objects, camera and lights. No OpenGL.

Rays find what is seen, and what hides the lights from it. Light without shadows is summed exactly
at every pixel; what is estimated is only its share that gets through: for the strongest lights by
rays from every pixel, for all others by one ray from one pixel of sixteen, whose neighbours on the
same surface take over what it saw.

Input  : a scene, a camera and LightSets.    Output : linear radiance, in the lights' scale.
Cost   : 100 to 150 ms of CPU time at 640×480 with 64 lights, half of that on two idle cores,
         everything new; nothing is kept but the triangles' hierarchy, which takes 2 ms per 70,000
         triangles when they move (tests/benchmarks/render.py).
Fails  : penumbrae of wide lights that are not the strongest are grainy, in a pattern that stands
         still on the screen. A single wide light is blurred by four pixels, and each point of its
         disc counts alike, whatever its cosine (tests/limits/test_render_moving.py). One sample per
         pixel may miss what is narrower. The light of a fill comes from a dome of discs (dome.py).
         Mirrors show the lights and not the map they stand for.
"""

from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from render.lights.discs import irradiance_curves
from render.lights.dome import dome_lights
from render.lights.reaching_lights import reaching_lights
from render.moving.neighbours import soften
from render.moving.shaded_light import add_lights
from render.moving.shadow_rays import (
    CURVE,
    DIRECTION,
    HALF,
    IRRADIANCE,
    POINTS,
    SPREAD,
    WIDTH,
    trace_lights,
)
from render.rays.disc_net import disc_net
from render.rays.embree import Occluders, intersect16_address, occluded16_address
from render.rays.first_hits import LANES, empty_surfaces, find_surfaces
from render.scenes.scene import Camera, Scene
from render.scenes.triangle_tables import gather_appearance, gather_geometry

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]

_OFFSET = 1e-4  # of the casters' radius: rays start that far off their surface
_POINT_RAD = 1e-3
_WIDE_RAD = 0.03
_SLOTS = 4  # the kernels move so many lights at once


@dataclass(frozen=True)
class Effort:
    """How many rays a picture is worth.

    Attributes
    ----------
    interleaving : int
        n of n × n pixels that share the rays to a light: 1, 2 or 4.
    key_lights : int
        Most lights to which every pixel sends rays.
    key_share : float
        Least share of all light that makes one.
    key_rays : int
        Rays of a pixel to a key light that is no point; a power of 2.
    soft_rad : float
        Radius from which on the penumbra of a key light is averaged over 4 × 4 pixels, being wider.
    is_softened : bool
        Whether what rays to the other lights saw is averaged over nine of them, if any is wide.
    """

    interleaving: int = 4
    key_lights: int = 4
    key_share: float = 0.1
    key_rays: int = 2
    soft_rad: float = 0.03
    is_softened: bool = True


class MovingRenderer:
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
        effort: Effort = Effort(),
    ) -> None:
        self._effort = effort
        self._samples_per_axis = samples_per_axis
        self._scene = scene
        self._geometry = gather_geometry(scene.meshes)
        self._appearance = gather_appearance([mesh.material for mesh in scene.meshes])
        self._occluders = Occluders(self._geometry.positions, self._geometry.faces)
        self._set_camera(camera)
        self._visible = np.zeros((0, 0, 0, 0), np.float32)
        self._softened = self._visible

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def release(self) -> None:
        """Free Embree's memory."""
        self._occluders.release()

    def move(self, scene: Scene | None = None, camera: Camera | None = None) -> None:
        """Draw another scene, or the same one from another camera, from now on.

        Meshes may move, change shape, come and go; materials that stay the same objects are not
        read again.
        """
        if scene is not None and scene is not self._scene:
            materials = [mesh.material for mesh in scene.meshes]
            before = [mesh.material for mesh in self._scene.meshes]
            if len(materials) != len(before) or any(
                new is not old for new, old in zip(materials, before, strict=True)
            ):
                self._appearance = gather_appearance(materials)
            geometry = gather_geometry(scene.meshes)
            occluders = Occluders(geometry.positions, geometry.faces, is_quick=True)
            self._occluders.release()
            self._scene, self._geometry, self._occluders = scene, geometry, occluders
        if camera is not None:
            self._set_camera(camera)

    def render(
        self, lights: LightSet, background: EnvironmentMap | None = None
    ) -> NDArray[np.float32]:
        """Return the picture under `lights`, as `Renderer.render` does."""
        self._find_surfaces()
        directions, irradiance, radius_rad = self._reaching(lights)
        keys = self._key_count(irradiance)
        per_turn, chosen = _take_turns(len(directions), keys, self._effort.interleaving)
        table = np.take(_light_table(directions, irradiance, radius_rad), chosen, axis=1)
        ray_count = np.ones(len(chosen), np.int64)
        ray_count[chosen < 0] = 0
        table[IRRADIANCE : IRRADIANCE + 3, chosen < 0] = 0.0
        ray_count[:keys][radius_rad[:keys] >= _POINT_RAD] = self._effort.key_rays
        net = disc_net(directions, radius_rad, POINTS * self._effort.key_rays)
        net[keys:, :POINTS] = disc_net(directions[keys:], radius_rad[keys:], POINTS)
        points = net.astype(np.float32)[chosen]

        rows, _, _, columns = self._surfaces.shape
        shape = rows, LANES, columns, keys + per_turn
        if self._visible.shape != shape:
            self._visible = np.zeros(shape, np.float32)
            self._softened = np.zeros(shape, np.float32)
        side = self._effort.interleaving
        tracing = (
            occluded16_address(), self._occluders.address, self._sphere(),
            _OFFSET * self._geometry.radius_m, self._surfaces,
        )  # fmt: skip
        trace_lights(*tracing, table, points, ray_count, keys, side, self._visible)
        visible = self._visible
        eye, pixel_rad = self._camera.eye.astype(np.float32), self._pixel_rad()
        if self._effort.is_softened and np.any(radius_rad[keys:] >= _WIDE_RAD):
            soften(self._surfaces, visible, keys, eye, pixel_rad, self._softened)
            visible = self._softened
        width, height = self._size_px
        picture = np.empty((height, width, 4), np.float32)
        seen_behind = np.zeros((1, 1, 3), np.float32)
        if background is not None:
            seen_behind = np.ascontiguousarray(background.radiance)
        is_soft = radius_rad[:keys] >= self._effort.soft_rad
        add_lights(
            *tracing, visible, table, points, is_soft, keys, side, eye, pixel_rad, seen_behind,
            picture,
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

    def _sphere(self) -> _FLOATS:
        return np.array([*self._geometry.centre, self._geometry.radius_m], np.float32)

    def _pixel_rad(self) -> float:
        return 2 * self._camera.half_extent()[1] / self._size_px[1]

    def _find_surfaces(self) -> None:
        width, height = self._size_px
        across, up = self._camera.half_extent()
        right, upward, backward = self._camera.axes()
        first = (1 / width - 1) * across * right + (1 - 1 / height) * up * upward - backward
        view = [self._camera.eye, 2 * across / width * right, -2 * up / height * upward, first]
        ground = self._scene.ground
        if ground is None:
            level = np.array([0, -1, 0, 0, 0], np.float32)
        else:
            rho = np.asarray(ground.reflectance) / np.pi
            level = np.array([ground.y_m, ground.radius_m, *rho], np.float32)
        geometry, look = self._geometry, self._appearance
        find_surfaces(
            intersect16_address(), self._occluders.address, self._sphere(),
            np.array(view, np.float32), level, geometry.positions, geometry.attributes,
            geometry.faces, geometry.mesh_of_face, look.factors, look.textures, look.texels,
            self._surfaces,
        )  # fmt: skip

    def _reaching(self, lights: LightSet) -> tuple[Array, Array, Array]:
        """Return the lights that reach the scene, the strongest first, a fill's dome among them."""
        parts = [reaching_lights(lights, self._scene)]
        if lights.fill.any():
            parts.append(dome_lights(lights.fill, upper_only=self._scene.ground is not None))
        directions, irradiance, radius_rad = (
            np.concatenate(each) for each in zip(*parts, strict=True)
        )
        if len(directions) == 0:  # the kernels want one
            return np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3)), np.zeros(1)
        order = np.argsort(-(irradiance @ LUMINANCE_WEIGHTS), kind="stable")
        return directions[order], irradiance[order], radius_rad[order]

    def _key_count(self, irradiance: Array) -> int:
        power = irradiance @ LUMINANCE_WEIGHTS
        strong = int(np.count_nonzero(power >= self._effort.key_share * power.sum()))
        return min(strong, self._effort.key_lights) if power.any() else 0


def _take_turns(count: int, keys: int, side: int) -> tuple[int, NDArray[np.int64]]:
    """Return how many lights have each turn, and which: the keys, then those of every turn.

    Turns get lights of any power alike: of each side² in a row, one. −1 stands for none.
    """
    turns = side * side
    per_turn = _SLOTS * -(-(count - keys) // (_SLOTS * turns))
    chosen = keys + np.arange(per_turn * turns).reshape(per_turn, turns).T.ravel()
    chosen[chosen >= count] = -1
    return per_turn, np.concatenate([np.arange(keys), chosen])


def _light_table(directions: Array, irradiance: Array, radius_rad: Array) -> _FLOATS:
    """Return the lights as the kernels have them, (WIDTH, K)."""
    table = np.zeros((WIDTH, len(directions)), np.float32)
    table[DIRECTION : DIRECTION + 3] = directions.T
    table[IRRADIANCE : IRRADIANCE + 3] = irradiance.T
    curves = irradiance_curves(radius_rad).T
    table[HALF], table[CURVE - 1], table[CURVE : CURVE + 3] = curves[0], curves[1], curves[2:]
    table[SPREAD] = radius_rad**2 / 8  # as in renderer.pack_lights
    return table
