"""What objects hide from pixels: traced once from the vertices of all that mirrors a map.

Output : a texture of four unsigned integers, the bytes of render/opengl/shaders/hidden_sky.frag.
Cost   : see render/rays/hidden_sky.py; when the camera moves, drawing the meshes once more.
Fails  : between vertices that are far apart, as on a box, it is interpolated.
"""

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.opengl.context import load_program, release, set_uniforms
from render.opengl.gbuffer import GBuffer
from render.rays.embree import Occluders
from render.rays.hidden_sky import COUNT, hidden_sky
from render.rays.traced_scene import OFFSET
from render.scenes.scene import Material, Mesh, Scene
from render.scenes.triangle_tables import gather_geometry


class HiddenSky:
    """Draws what is hidden from the pixels of a G-buffer to `texture`.

    Owns GL objects; the context that made them must be current.

    Parameters
    ----------
    context : moderngl.Context
    scene : Scene
    gbuffer : GBuffer
    rough_alpha : float
        What is rougher mirrors no map, and nothing is traced for it.
    """

    def __init__(
        self, context: moderngl.Context, scene: Scene, gbuffer: GBuffer, rough_alpha: float
    ) -> None:
        self._context = context
        self._gbuffer = gbuffer
        self.texture = context.texture(gbuffer.size_px, 4, dtype="u4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth = context.depth_renderbuffer(gbuffer.size_px)
        self._framebuffer = context.framebuffer([self.texture], self._depth)
        self._program = load_program(context, "hidden_sky.vert", "hidden_sky.frag")
        hidden = _hidden(scene, rough_alpha)
        self._buffers: list[moderngl.Buffer] = []
        self._arrays = [
            self._vertex_array(mesh, each) for mesh, each in zip(scene.meshes, hidden, strict=True)
        ]
        self.draw()

    def draw(self) -> None:
        """Draw it for the camera that the G-buffer was drawn for."""
        set_uniforms(self._program, world_to_clip=self._gbuffer.world_to_clip.T)
        self._framebuffer.use()
        self._framebuffer.clear()
        self._context.enable_only(moderngl.DEPTH_TEST)
        for array in self._arrays:
            array.render()

    def release(self) -> None:
        """Free the GL objects."""
        release(
            self._context,
            self._framebuffer,
            self._depth,
            self.texture,
            *self._arrays,
            *self._buffers,
            self._program,
        )

    def _vertex_array(self, mesh: Mesh, hidden: NDArray[np.float32]) -> moderngl.VertexArray:
        vertices = np.concatenate([mesh.positions, hidden], axis=1)
        buffer = self._context.buffer(vertices.tobytes())
        indices = self._context.buffer(np.ascontiguousarray(mesh.faces).tobytes())
        self._buffers += [buffer, indices]
        names = ("position", "order_0_1", "order_2", "order_2_3", "order_3")
        return self._context.vertex_array(
            self._program, [(buffer, "3f 4f 4f 4f 4f", *names)], index_buffer=indices
        )


def _hidden(scene: Scene, rough_alpha: float) -> list[NDArray[np.float32]]:
    """Return what is hidden from each mesh's vertices, (V, COUNT) float32; 0 of what is rough."""
    geometry = gather_geometry(scene.meshes)
    hidden = [np.zeros((len(mesh.positions), COUNT), np.float32) for mesh in scene.meshes]
    with Occluders(geometry.positions, geometry.faces) as occluders:
        for k, mesh in enumerate(scene.meshes):
            if _mirrors(mesh.material, rough_alpha):
                offset_m = OFFSET * geometry.radius_m
                hidden[k] = hidden_sky(occluders, mesh.positions, mesh.normals, offset_m)
    return hidden


def _mirrors(material: Material, rough_alpha: float) -> bool:
    is_smooth = material.roughness**2 < rough_alpha
    has_parts = material.roughness_metalness_texture is not None
    return (is_smooth or has_parts) and max(material.metalness, material.specular) > 0
