"""What smooth surfaces mirror of a map: rays of every pixel's lobe, looked up in its mipmaps.

As render/moving/reflected_map.py has it, but what stops the rays is known from vertices alone.

Input  : a G-buffer; a map per picture.    Output : radiance, added to a framebuffer.
Cost   : a picture, the upload of the map; a ray of a pixel that mirrors, a look-up.
Fails  : no object is seen in another, and the outline of what hides the map is blurred
         (render/rays/hidden_sky.py). Below the horizon a ground is seen as if nothing stood on it.
"""

import moderngl
import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from render.lights.peaks import ROUGH_ALPHA
from render.opengl.context import load_program, release, set_uniforms
from render.opengl.gbuffer import GBuffer
from render.opengl.hidden_sky import HiddenSky
from render.scenes.scene import Scene

Array = NDArray[np.float64]

_RAYS, _FEW_RAYS = 12, 4
_LEAST_OCTAVE = 2  # the coarsest map has 4 rows


class ReflectedMap:
    """Adds what is mirrored of maps to pictures.

    Owns GL objects; the context that made them must be current.
    """

    def __init__(
        self, context: moderngl.Context, scene: Scene, gbuffer: GBuffer, eye: Array
    ) -> None:
        self._context = context
        self._hidden = HiddenSky(context, scene, gbuffer, ROUGH_ALPHA)
        self._weigh_program = load_program(context, "screen.vert", "weigh_map.frag")
        self._weigh = context.vertex_array(self._weigh_program, [])
        self._mirror_program = load_program(
            context, "screen.vert", "reflected_map.frag", RAYS=_RAYS, FEW_RAYS=_FEW_RAYS
        )
        self._mirror = context.vertex_array(self._mirror_program, [])
        textures = (*gbuffer.textures, ("hidden_sky", self._hidden.texture))
        self._inputs = [each for each in textures if each[0] in self._mirror_program]
        for unit, (name, _) in enumerate(self._inputs):
            set_uniforms(self._mirror_program, **{name: unit})
        set_uniforms(self._mirror_program, weighed_map=len(self._inputs))
        set_uniforms(self._mirror_program, rough_alpha2=ROUGH_ALPHA**2)
        self._map: moderngl.Texture | None = None
        self._weighed: moderngl.Texture | None = None
        self._weighing: moderngl.Framebuffer | None = None
        set_uniforms(self._mirror_program, eye=eye)

    def look_from(self, eye: Array) -> None:
        """Take over what the G-buffer holds, now that it was drawn from `eye`."""
        self._hidden.draw()
        set_uniforms(self._mirror_program, eye=eye)

    def add(
        self,
        target: moderngl.Framebuffer,
        environment: EnvironmentMap,
        ground: NDArray[np.floating] | None,
    ) -> None:
        """Add what is mirrored of a map to `target`.

        `ground`, (3,), is its radiance below the horizon; what the map shows there if None.
        """
        weighed = self._mipmaps(environment)
        for unit, (_, texture) in enumerate(self._inputs):
            texture.use(unit)
        weighed.use(len(self._inputs))
        set_uniforms(
            self._mirror_program,
            ground=np.zeros(4) if ground is None else np.append(ground, 1.0),
            coarsest=float(_octaves(weighed.height) - _LEAST_OCTAVE),
        )
        target.use()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        self._mirror.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the GL objects."""
        self._release_maps()
        release(self._context, self._weigh, self._weigh_program, self._mirror, self._mirror_program)

    def _mipmaps(self, environment: EnvironmentMap) -> moderngl.Texture:
        """Return the map and its halves, the finest of a power of two of rows."""
        size = 2 * environment.height, environment.height
        if self._map is None or self._map.size != size:
            self._release_maps()
            self._map = self._context.texture(size, 3, dtype="f4")
            self._map.repeat_y = False
            rows = 1 << max(_octaves(environment.height), _LEAST_OCTAVE + 1)
            self._weighed = self._context.texture((2 * rows, rows), 4, dtype="f4")
            self._weighed.repeat_y = False
            self._weighing = self._context.framebuffer([self._weighed])
        assert self._weighed is not None
        assert self._weighing is not None
        self._map.write(np.ascontiguousarray(environment.radiance))
        self._map.use(0)
        self._weighing.use()
        self._context.enable_only(moderngl.NOTHING)
        self._weigh.render(moderngl.TRIANGLES, vertices=3)
        self._weighed.build_mipmaps(0, _octaves(self._weighed.height) - _LEAST_OCTAVE)
        self._weighed.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        return self._weighed

    def _release_maps(self) -> None:
        release(self._context, self._weighing, self._weighed, self._map)
        self._map = self._weighed = self._weighing = None


def _octaves(rows: int) -> int:
    """Return the least power of two, as an exponent, that is at least so many."""
    return (rows - 1).bit_length()
