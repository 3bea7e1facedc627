"""Pictures from lights: every light's shadow map, and their sum over what each pixel shows.

Input  : a scene, a camera and LightSets.    Output : linear radiance, in the lights' scale.
Cost   : on llvmpipe and 2 cores see tests/benchmarks/render.py.
Fails  : only light that comes straight from the lights and the map is there: nothing lights another
         thing, but that smooth surfaces mirror the ground. Without a map they mirror the lights.
         Light that facets pass on to each other is lost: a white metal of roughness 1 reflects
         41 %. A smooth dielectric is up to 4 % too bright (tests/limits/test_render_energy.py).
         Penumbrae are estimates (tests/limits/test_render_soft_shadows.py).
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import moderngl
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from render.lights.all_lights import unshaded_ground
from render.lights.discs import Discs
from render.lights.dome import dome_lights
from render.lights.peaks import ROUGH_ALPHA, without_peaks
from render.lights.reaching_lights import reaching_lights
from render.opengl.context import load_program, release, set_uniforms
from render.opengl.gbuffer import GBuffer
from render.opengl.reflected_map import ReflectedMap
from render.opengl.shading import LightPass
from render.opengl.shadows import ATLAS_SIDE_PX, ShadowAtlas, texel_width
from render.owner import Owner
from render.scenes.casters import Casters, gather_casters
from render.scenes.scene import Camera, Scene
from render.scenes.shadow_proxies import shadow_proxy

KEY_LIGHTS = 4
"""The strongest, which every sample looks at, in the finest maps."""
KEY_MAP_PX, KEY_ATLAS_SIDE_PX = 1024, 2048
LARGEST_MAP_PX = 256
"""Of the other lights and of the dome: their shadows are blurred."""
DOME_ATLAS_SIDE_PX = 2048
"""Holds maps of 256² for the whole dome."""

PROXIES_FROM = 50_000
"""Triangles from which shadows are those of proxies. To make them takes 4 to 6 µs for each, and
saves 0.1 µs for most of them and each map: at a million it is worth it for a single picture."""
PROXY_ERROR_TEXELS = 0.5

INTERLEAVING = 4
"""n of n × n samples that share the looking at the other lights."""

MAX_SAMPLES = 2**26
"""Samples of a picture, each of which takes 116 bytes: 4096 × 4096 pixels of 2 × 2."""


Array = NDArray[np.float64]
Timed = Callable[[str], AbstractContextManager[object]]


class Renderer(Owner):
    """Draws one scene from one camera under any number of light sets.

    What does not depend on the lights is drawn once; a shadow map is drawn again only when its
    light's direction changes. Owns GL objects: use it as a context manager, from one thread.

    Parameters
    ----------
    context : moderngl.Context
    scene : Scene
    camera : Camera
    samples_per_axis : int
        Each pixel is the mean of its square of samples, a box filter in linear radiance.
    interleaving : int
        n = 1, 2 or 4: of n × n samples each looks whether it sees one in n² of the lights that are
        no key lights, and takes over from its neighbours what they saw of the others.
    map_px : int
        Largest shadow map of a light that is no key light.

    Attributes
    ----------
    framebuffer : moderngl.Framebuffer
        Four float32 for each sample of what `draw` drew, rows from the bottom.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        camera: Camera,
        samples_per_axis: int = 1,
        interleaving: int = INTERLEAVING,
        map_px: int = LARGEST_MAP_PX,
    ) -> None:
        if samples_per_axis < 1:
            raise InputError(f"a pixel needs at least one sample, got {samples_per_axis} per axis")
        if interleaving not in (1, 2, 4):
            raise InputError(f"1, 2 or 4 samples in a row share lights, not {interleaving}")
        self._context = context
        self._scene = scene
        self._camera = camera
        self._samples_per_axis = samples_per_axis
        width, height = (samples_per_axis * length for length in camera.size_px)
        largest = context.info["GL_MAX_TEXTURE_SIZE"]
        if max(width, height) > largest or width * height > MAX_SAMPLES:
            raise InputError(
                f"{width}×{height} samples are more than are drawn at once ({largest} per axis, "
                f"{MAX_SAMPLES} together): ask for a smaller picture or fewer samples"
            )
        self._gbuffer = GBuffer(context, scene, camera, (width, height))
        key_casters = gather_casters(scene.meshes)
        if len(key_casters.closed_faces) + len(key_casters.open_faces) >= PROXIES_FROM:
            key_casters = as_maps_see(key_casters, KEY_MAP_PX)
            self._casters = as_maps_see(key_casters, map_px)
        else:
            self._casters = key_casters
        self._key_atlas = ShadowAtlas(context, key_casters, KEY_ATLAS_SIDE_PX, KEY_MAP_PX)
        self._atlas = ShadowAtlas(context, self._casters, ATLAS_SIDE_PX, map_px)
        self._dome_atlas: ShadowAtlas | None = None
        self._sum = context.texture((width, height), 4, dtype="f4")
        self.framebuffer = context.framebuffer([self._sum])
        self._background_program = load_program(context, "screen.vert", "background.frag")
        self._background = context.vertex_array(self._background_program, [])
        self._full = LightPass(context, self._gbuffer, camera.eye, 1)
        is_shared = interleaving > 1 and min(width, height) >= interleaving
        self._shared = (
            LightPass(context, self._gbuffer, camera.eye, interleaving) if is_shared else self._full
        )
        self._reflected_map: ReflectedMap | None = None
        self._environment = context.texture((1, 1), 3, bytes(12), dtype="f4")
        set_uniforms(self._background_program, position_hit=0, environment=1)
        self._aim_background()

    def look_from(self, camera: Camera) -> None:
        """Draw from another camera from now on, whose pictures have the same size."""
        if camera.size_px != self._camera.size_px:
            raise InputError(
                f"pictures of {self._camera.size_px} pixels cannot become ones of {camera.size_px}"
            )
        self._camera = camera
        self._gbuffer.draw(camera)
        for light_pass in {self._full, self._shared}:
            light_pass.look_from(camera.eye)
        if self._reflected_map is not None:
            self._reflected_map.look_from(camera.eye)
        self._aim_background()

    def render(
        self, lights: LightSet, background: EnvironmentMap | None = None
    ) -> NDArray[np.float32]:
        """Return the picture under `lights`.

        Parameters
        ----------
        lights : LightSet
            Without lights and fill the scene is black.
        background : EnvironmentMap, optional
            Seen where there is nothing else, and mirrored by smooth surfaces. Without it what is
            behind the scene is black, and they mirror the lights.

        Returns
        -------
        (H, W, 4) float32
            Linear Rec.709 radiance toward the camera, rows from the top, in the lights' scale;
            alpha is the share of the pixel that the scene covers.
        """
        self.draw(lights, background)
        return self.as_picture(self.framebuffer.read(components=4, dtype="f4"))

    def draw(
        self,
        lights: LightSet,
        background: EnvironmentMap | None = None,
        *,
        most_maps: int | None = None,
        timed: Timed = nullcontext,
    ) -> int:
        """Draw the samples of the picture under `lights` to `framebuffer`; return the maps drawn.

        Parameters
        ----------
        lights, background
            As in `render`.
        most_maps : int or None
            Most shadow maps of lights that turned to draw anew; key lights come first. Of more
            lights than the atlas holds, all are drawn.
        timed : callable
            Given the name of a part, returns a context manager around it.
        """
        with timed("background"):
            self._draw_background(background)
        discs, dome_count = self._discs(lights)
        rough_alpha = 0.0
        if background is not None:
            rest, discs = without_peaks(background, discs)
            self._reflected_map = self._reflected_map or ReflectedMap(
                self._context, self._scene, self._gbuffer, self._camera.eye
            )
            with timed("reflections"):
                self._reflected_map.add(self.framebuffer, rest, self._ground(discs))
            rough_alpha = ROUGH_ALPHA
        reaching, dome = discs.taken(slice(dome_count, None)), discs.taken(slice(dome_count))
        power = reaching.irradiance @ LUMINANCE_WEIGHTS
        is_key = np.zeros(len(reaching), bool)
        is_key[np.argsort(-power, kind="stable")[:KEY_LIGHTS]] = True
        sets = [
            (self._full, self._key_atlas, is_key),
            (self._shared, self._atlas, ~is_key),
        ]
        maps = 0
        for light_pass, atlas, part in sets:
            left = None if most_maps is None else max(most_maps - maps, 0)
            maps += self._add_lights(
                light_pass, atlas, reaching.taken(part), rough_alpha, left, timed
            )
        if len(dome) > 0:
            # An atlas of its own: lights that come and go would displace the dome's maps.
            self._dome_atlas = self._dome_atlas or ShadowAtlas(
                self._context, self._casters, DOME_ATLAS_SIDE_PX, LARGEST_MAP_PX
            )
            maps += self._add_lights(self._shared, self._dome_atlas, dome, rough_alpha, None, timed)
        return maps

    def as_picture(self, samples: bytes) -> NDArray[np.float32]:
        """Return the picture whose samples were read from `framebuffer`, (H, W, 4) float32."""
        width, height = self._camera.size_px
        n = self._samples_per_axis
        shaped = np.frombuffer(samples, np.float32).reshape(height, n, width, n, 4)
        picture = shaped[:, 0, :, 0] if n == 1 else shaped.mean(axis=(1, 3), dtype=np.float32)
        return np.ascontiguousarray(picture[::-1])

    def release(self) -> None:
        """Free the GL objects; the context stays."""
        self._gbuffer.release()
        if self._reflected_map is not None:
            self._reflected_map.release()
        for light_pass in {self._full, self._shared}:
            light_pass.release()
        for atlas in (self._key_atlas, self._atlas, self._dome_atlas):
            if atlas is not None:
                atlas.release()
        release(
            self._context,
            self.framebuffer,
            self._sum,
            self._background,
            self._background_program,
            self._environment,
        )

    def _discs(self, lights: LightSet) -> tuple[Discs, int]:
        """Return a fill's dome and the lights that reach the scene; how many are the dome's."""
        dome = []
        if lights.fill.any():
            dome = [dome_lights(lights.fill, upper_only=self._scene.ground is not None)]
        parts = zip(*dome, reaching_lights(lights, self._scene), strict=True)
        directions, irradiance, radius_rad = (np.concatenate(each) for each in parts)
        count = len(dome[0][0]) if dome else 0
        return Discs(directions, irradiance, radius_rad, irradiance), count

    def _ground(self, lights: Discs) -> NDArray[np.float32] | None:
        """Return the radiance (3,) of the ground where nothing shades it; None without a ground."""
        if self._scene.ground is None:
            return None
        return unshaded_ground(self._scene, lights.directions, lights.irradiance, lights.radius_rad)

    def _aim_background(self) -> None:
        across, up = self._camera.half_extent()
        # What one unit of ndc.x, of ndc.y and of 1 adds to the direction.
        columns = self._camera.axes() * [[across], [up], [-1.0]]
        set_uniforms(self._background_program, ray=columns)

    def _draw_background(self, background: EnvironmentMap | None) -> None:
        size = (1, 1) if background is None else (2 * background.height, background.height)
        if self._environment.size != size:
            self._environment.release()
            self._environment = self._context.texture(size, 3, dtype="f4")
            self._environment.repeat_x, self._environment.repeat_y = True, False
        self._environment.write(
            bytes(12) if background is None else np.ascontiguousarray(background.radiance)
        )
        self.framebuffer.use()
        self._context.enable_only(moderngl.NOTHING)
        self._gbuffer.textures[0][1].use(0)
        self._environment.use(1)
        self._background.render(moderngl.TRIANGLES, vertices=3)

    def _add_lights(
        self,
        light_pass: LightPass,
        atlas: ShadowAtlas,
        lights: Discs,
        rough_alpha: float,
        most_maps: int | None,
        timed: Timed,
    ) -> int:
        maps = 0
        if len(lights) > atlas.capacity:
            most_maps = None  # what is there is no older map of a light, but another light's
        for first in range(0, len(lights), atlas.capacity):
            part = lights.taken(slice(first, first + atlas.capacity))
            with timed("shadow maps"):
                maps += atlas.draw(part.directions, part.irradiance @ LUMINANCE_WEIGHTS, most_maps)
            with timed("lights"):
                light_pass.add(self.framebuffer, atlas, part, rough_alpha)
        return maps


def as_maps_see(casters: Casters, map_px: int) -> Casters:
    """Return casters that are off by no more than maps of this size can tell."""
    return shadow_proxy(casters, PROXY_ERROR_TEXELS * texel_width(casters.radius_m, map_px))
