"""Light on a picture: what of each light every pixel sees, and the sum of what it reflects.

Input  : a G-buffer, shadow maps, lights.    Output : radiance, added to a framebuffer.
Cost   : where pixels take turns, each looks at one light in side² and shades all of them.
Fails  : shadows narrower than `side` pixels are blurred by as much where pixels take turns, and
         penumbrae, estimated from 16 texels, have blotches as large; elsewhere, from 32, they have
         grain. Neither moves on the screen. Of two casters in a line only the one nearer to the
         light is in its map, and a penumbra of casters at several distances is that of their mean.
"""

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.lights.discs import Discs, irradiance_curves
from render.opengl.context import load_program, release, set_uniforms
from render.opengl.gbuffer import GBuffer
from render.opengl.shadows import ShadowAtlas, texel_width

Array = NDArray[np.float64]

_TAPS, _TAPS_OF_TURNS = 32, 16
_LIGHT_BYTES = 8 * 16


class LightPass:
    """Adds lights to a picture, a batch at a time.

    Owns GL objects; the context that made them must be current.

    Parameters
    ----------
    context : moderngl.Context
    gbuffer : GBuffer
    eye : (3,) float64
    side : int
        n of n × n pixels that share the looking at lights: 1, 2 or 4. The picture must have as
        many rows and columns.
    """

    def __init__(self, context: moderngl.Context, gbuffer: GBuffer, eye: Array, side: int) -> None:
        self._context = context
        self._gbuffer = gbuffer
        self.batch = 4 * side * side
        size_px = gbuffer.size_px
        self._visible = context.texture(size_px, 4)
        self._seeing = context.framebuffer([self._visible])
        self._lights = context.buffer(reserve=self.batch * _LIGHT_BYTES)
        self._see_program = load_program(
            context,
            "screen.vert",
            "lights.glsl",
            "visibility.frag",
            SIDE=side,
            TAPS=_TAPS if side == 1 else _TAPS_OF_TURNS,
        )
        self._shade_program = load_program(
            context, "screen.vert", "lights.glsl", "shade.frag", SIDE=side
        )
        self._see = context.vertex_array(self._see_program, [])
        self._shade = context.vertex_array(self._shade_program, [])
        self._textures = [*gbuffer.textures, ("visible", self._visible)]
        self._neighbours = _Neighbours(context, gbuffer, side) if side > 1 else None
        if self._neighbours is not None:
            self._textures.append(("same_surface", self._neighbours.same))
        for program in (self._see_program, self._shade_program):
            for unit, (name, _) in enumerate(self._textures):
                if name in program:
                    set_uniforms(program, **{name: unit})
            lights: Any = program["Lights"]
            lights.binding = 0
        set_uniforms(self._see_program, atlas=len(self._textures))
        self.look_from(eye)

    def look_from(self, eye: Array) -> None:
        """Take over what the G-buffer holds, now that it was drawn from `eye`."""
        set_uniforms(self._shade_program, eye=eye)
        if self._neighbours is not None:
            self._neighbours.find()

    def add(
        self,
        target: moderngl.Framebuffer,
        atlas: ShadowAtlas,
        lights: Discs,
        rough_alpha: float,
    ) -> None:
        """Add up to the atlas' capacity of lights, whose maps are drawn, to `target`.

        Surfaces smoother than `rough_alpha` mirror what is `mirrored` of a light.
        """
        set_uniforms(
            self._see_program,
            texel_m=texel_width(atlas.radius_m, atlas.tile_px),
            tile_px=float(atlas.tile_px),
            error_m=atlas.error_m,
        )
        set_uniforms(self._shade_program, rough_alpha2=rough_alpha**2)
        packed = pack_lights(lights, atlas.rows(len(lights)), atlas.tiles(len(lights)))
        for unit, (_, texture) in enumerate(self._textures):
            texture.use(unit)
        atlas.texture.use(len(self._textures))
        self._lights.bind_to_uniform_block(0)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        for first in range(0, len(packed), self.batch):
            batch = packed[first : first + self.batch]
            self._lights.orphan()  # the last batch may still be in use
            self._lights.write(batch.tobytes())
            for program in (self._see_program, self._shade_program):
                set_uniforms(program, light_count=len(batch))
            self._seeing.use()
            self._context.enable_only(moderngl.NOTHING)
            self._see.render(moderngl.TRIANGLES, vertices=3)
            target.use()
            self._context.enable_only(moderngl.BLEND)
            self._shade.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the GL objects."""
        if self._neighbours is not None:
            self._neighbours.release()
        release(
            self._context,
            self._seeing,
            self._visible,
            self._lights,
            self._see,
            self._see_program,
            self._shade,
            self._shade_program,
        )


class _Neighbours:
    """Which neighbours of each pixel show its surface, as same_surface.frag has it: `same`."""

    def __init__(self, context: moderngl.Context, gbuffer: GBuffer, side: int) -> None:
        self._context = context
        self._gbuffer = gbuffer
        self.same = context.texture(gbuffer.size_px, 2, dtype="u4")
        self.same.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._program = load_program(context, "screen.vert", "same_surface.frag", SIDE=side)
        self._framebuffer = context.framebuffer([self.same])
        self._screen = context.vertex_array(self._program, [])
        for unit, (name, _) in enumerate(gbuffer.textures):
            if name in self._program:
                set_uniforms(self._program, **{name: unit})

    def find(self) -> None:
        for unit, (_, texture) in enumerate(self._gbuffer.textures):
            texture.use(unit)
        self._framebuffer.use()
        self._context.enable_only(moderngl.NOTHING)
        self._screen.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        release(self._context, self._framebuffer, self.same, self._screen, self._program)


def pack_lights(lights: Discs, rows: Array, tiles: Array) -> NDArray[np.float32]:
    """Return the lights as lights.glsl's uniform block has them, (K, 8, 4) float32.

    A light of angular radius r spreads the directions it comes from by r²/4 per axis, and half
    vectors by a quarter of that. GGX with width α has the core of a distribution of slopes of
    variance α²/2, so the highlight of the whole extent is that of α² + r²/8: the first order of
    a convolution, good while r is small.
    """
    curves = irradiance_curves(lights.radius_rad)
    packed: NDArray[Any] = np.zeros((len(rows), 8, 4), np.float32)
    packed[:, :3] = rows
    packed[:, 3, :3] = lights.directions
    packed[:, 3, 3] = lights.radius_rad**2 / 8
    packed[:, 4, :3] = lights.irradiance
    packed[:, 4, 3] = curves[:, 0]
    packed[:, 5, :3] = lights.mirrored
    packed[:, 6, :3] = tiles
    packed[:, 7] = curves[:, 1:]
    return packed
