"""Shadow maps: how far light from each direction reaches, one tile of a depth atlas per light.

Input  : casters and directions.    Output : a depth texture, and where each light's tile is in it.
Cost   : about 0.1 µs per triangle and light on llvmpipe; nothing for a light that did not move.
Fails  : for casters thinner than a texel (2 × radius / tile size), which may fall between samples.

Each map is orthographic and fitted to the casters' bounding sphere, so that no caster is ever
clipped and the width of a texel in the world is the same for every light. Receivers need not lie
inside: beside the sphere nothing casts, and behind it depth is held at its far side.
"""

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.opengl.context import load_program, release, set_uniforms
from render.scenes.casters import Casters

ATLAS_SIDE_PX = 4096
SMALLEST_TILE_PX = 128
_BORDER_TEXELS = 2  # free of casters on each side of a tile
_TILE_BYTES = (3 * 4 + 2) * 4


def tile_size(light_count: int, side_px: int, largest_px: int) -> int:
    """Width of a light's tile in pixels: the largest of which as many fit, a power of 2.

    Never below 128, so that more lights than fit take turns in the atlas.
    """
    size = min(largest_px, side_px)
    while size > SMALLEST_TILE_PX and (side_px // size) ** 2 < light_count:
        size //= 2
    return size


def world_to_tile(
    directions: NDArray[np.float64], centre: NDArray[np.float64], radius_m: float, size_px: int
) -> NDArray[np.float64]:
    """Return affine maps from the world to each light's tile and depth.

    Parameters
    ----------
    directions : (K, 3) float64
        Unit vectors toward the lights.
    centre, radius_m : (3,), float
        The casters' bounding sphere.
    size_px : int
        Width of a tile.

    Returns
    -------
    (K, 3, 4) float64
        Rows u, v and depth, for (x, y, z, 1); the sphere lies in [0, 1], with the border free.
    """
    x, y, z = directions.T
    # Duff et al., "Building an Orthonormal Basis, Revisited" (JCGT 6(1), 2017), with +Y as the
    # pole: continuous over the upper hemisphere, so that a moving light's texels do not spin.
    sign = np.copysign(1.0, y)
    a = -1.0 / (sign + y)
    b = z * x * a
    across = np.stack([sign + x * x * a, -x, b], axis=-1)
    along = np.stack([sign * b, -sign * z, 1.0 + sign * z * z * a], axis=-1)
    axes = np.stack([along, across, -directions], axis=1)
    scale = 0.5 / (radius_m * size_px / (size_px - 2 * _BORDER_TEXELS))
    rows = np.empty((len(directions), 3, 4))
    rows[..., :3] = scale * axes
    rows[..., 3] = 0.5 - scale * (axes @ centre)
    return rows


def texel_width(radius_m: float, size_px: int) -> float:
    """Width of a texel in the world, in m."""
    return 2 * radius_m / (size_px - 2 * _BORDER_TEXELS)


class ShadowAtlas:
    """A depth texture with a tile per light, redrawn only for lights that turned by so much.

    A map holds while at the edge of the casters' sphere its light is off by less than half a texel.
    A light's tile depends on its place in the list and on the number of lights alone.

    Owns GL objects; the context that made them must be current.

    Parameters
    ----------
    context : moderngl.Context
    casters : Casters
    side_px : int
        Width of the atlas.
    largest_px : int
        Of a tile; it is smaller where more lights have to fit.
    """

    def __init__(
        self, context: moderngl.Context, casters: Casters, side_px: int, largest_px: int
    ) -> None:
        self.centre = casters.centre
        # Without casters any positive size will do.
        self.radius_m = casters.radius_m or 1.0
        self.error_m = casters.error_m
        self._context = context
        self._program = load_program(context, "depth.vert", "depth.frag")
        self._positions = context.buffer(casters.positions.tobytes() or bytes(4))
        self.side_px = min(side_px, context.info["GL_MAX_TEXTURE_SIZE"])
        self._tiles = context.buffer(reserve=self.capacity * _TILE_BYTES)
        self._closed = self._vertex_array(casters.closed_faces)
        self._open = self._vertex_array(casters.open_faces)
        self.texture = context.depth_texture((self.side_px, self.side_px))
        self.texture.compare_func = ""
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._framebuffer = context.framebuffer(depth_attachment=self.texture)
        self.tile_px = 0
        self._largest_px = largest_px
        self._drawn = np.empty((0, 3))

    @property
    def capacity(self) -> int:
        """Most lights that the atlas holds at once."""
        return (self.side_px // SMALLEST_TILE_PX) ** 2

    def draw(
        self,
        directions: NDArray[np.float64],
        weights: NDArray[np.float64] | None = None,
        most: int | None = None,
    ) -> int:
        """Make the maps of up to `capacity` lights current; return how many had to be drawn.

        Parameters
        ----------
        directions : (K, 3) float64
        weights : (K,) float64 or None
            With `most`: how much each light matters; of those that turned, the maps with the
            largest product of weight and angle are drawn.
        most : int or None
            How many that are there already are drawn anew at most.
        """
        self._lay_out(len(directions))
        turned = np.linalg.norm(directions - self._drawn[: len(directions)], axis=1)
        is_new = np.isnan(turned)
        changed = np.flatnonzero(is_new | (turned > 1 / (self.tile_px - 2 * _BORDER_TEXELS)))
        if most is not None:
            matters = np.where(is_new, np.inf, turned if weights is None else weights * turned)
            changed = changed[np.argsort(-matters[changed], kind="stable")]
            changed = np.sort(changed[: np.count_nonzero(is_new) + most])
        self._drawn[changed] = directions[changed]
        self._draw_tiles(changed)
        return len(changed)

    def rows(self, count: int) -> NDArray[np.float64]:
        """Return what maps the world to the first `count` maps, as `world_to_tile`."""
        return world_to_tile(self._drawn[:count], self.centre, self.radius_m, self.tile_px)

    def tiles(self, count: int) -> NDArray[np.float64]:
        """Origin (x, y) and width of the first `count` tiles in texture coordinates, (count, 3)."""
        tiles = np.column_stack([self._tile_origins(count), np.full(count, self.tile_px)])
        return tiles / self.side_px

    def release(self) -> None:
        """Free the GL objects."""
        release(
            self._context,
            self._framebuffer,
            self.texture,
            self._closed,
            self._open,
            self._positions,
            self._tiles,
            self._program,
        )

    def _draw_tiles(self, changed: NDArray[np.intp]) -> None:
        if len(changed) == 0:
            return
        origins = self._tile_origins(len(self._drawn))[changed]
        rows = world_to_tile(self._drawn[changed], self.centre, self.radius_m, self.tile_px)
        instances = np.column_stack([rows.reshape(-1, 12), origins / self.side_px])
        self._tiles.orphan()  # the last ones may still be in use
        self._tiles.write(instances.astype(np.float32).tobytes())
        set_uniforms(self._program, tile_share=self.tile_px / self.side_px)
        self._framebuffer.use()
        for x, y in origins:
            self._framebuffer.clear(
                depth=1.0, viewport=(int(x), int(y), self.tile_px, self.tile_px)
            )
        if self._closed is not None:
            self._context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            self._closed.render(instances=len(changed))
        if self._open is not None:
            self._context.enable_only(moderngl.DEPTH_TEST)
            self._open.render(instances=len(changed))

    def _vertex_array(self, faces: NDArray[np.int32]) -> moderngl.VertexArray | None:
        if len(faces) == 0:
            return None
        return self._context.vertex_array(
            self._program,
            [
                (self._positions, "3f", "position"),
                (self._tiles, "4f 4f 4f 2f /i", "row_u", "row_v", "row_depth", "origin"),
            ],
            index_buffer=self._context.buffer(faces.tobytes()),
        )

    def _tile_origins(self, count: int) -> NDArray[np.intp]:
        rows, columns = np.divmod(np.arange(count), self.side_px // self.tile_px)
        return np.stack([columns, rows], axis=-1) * self.tile_px

    def _lay_out(self, count: int) -> None:
        """Choose the width of tiles for `count` lights; another width forgets all maps."""
        tile_px = tile_size(count, self.side_px, self._largest_px)
        if tile_px != self.tile_px:
            self.tile_px = tile_px
            self._drawn = np.full(((self.side_px // tile_px) ** 2, 3), np.nan)
