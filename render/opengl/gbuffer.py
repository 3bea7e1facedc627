"""The G-buffer: what is seen through each pixel, drawn anew when the camera moves.

Output : five float textures: position and hit, shading normal and roughness, face normal and f90,
         diffuse reflectance, f0 (render/opengl/shaders/gbuffer.frag).
Cost   : about 11 ms at 640×480 on llvmpipe.
"""

import math
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.opengl.context import load_program, release, set_uniforms
from render.scenes.scene import Camera, Ground, Material, Mesh, Scene

_TARGETS = (
    "position_hit",
    "normal_roughness",
    "face_normal_f90",
    "diffuse_reflectance",
    "f0",
)
_SRGB8 = 0x8C41  # GL_SRGB8, which moderngl has no name for
_GROUND_SIDES = 256


class GBuffer:
    """Float textures of a scene seen by a camera; (name, texture) pairs in `textures`.

    Owns GL objects; the context that made them must be current.

    Attributes
    ----------
    world_to_clip : (4, 4) float64
        Of the camera that was drawn last.
    """

    def __init__(
        self, context: moderngl.Context, scene: Scene, camera: Camera, size_px: tuple[int, int]
    ) -> None:
        self._context = context
        self.size_px = size_px
        self.textures = tuple((name, context.texture(size_px, 4, dtype="f4")) for name in _TARGETS)
        for _, texture in self.textures:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth = context.depth_renderbuffer(size_px)
        self._framebuffer = context.framebuffer([each for _, each in self.textures], self._depth)
        self._program = load_program(context, "gbuffer.vert", "gbuffer.frag")
        self._points = np.concatenate([mesh.positions for mesh in _all_meshes(scene)])
        of_meshes = sum(len(mesh.positions) for mesh in scene.meshes)
        self._near_count = of_meshes or len(self._points)  # the ground, last, is too wide to tell
        self._meshes = [_upload(context, self._program, mesh) for mesh in _all_meshes(scene)]
        self.draw(camera)

    def draw(self, camera: Camera) -> None:
        """Draw what `camera` sees."""
        near_m, far_m = _depth_range(self._points, self._near_count, camera)
        self.world_to_clip = camera.world_to_clip(near_m, far_m)
        set_uniforms(self._program, world_to_clip=self.world_to_clip.T, eye=camera.eye)
        self._framebuffer.use()
        self._framebuffer.clear()
        self._context.enable_only(moderngl.DEPTH_TEST)
        for mesh in self._meshes:
            set_uniforms(self._program, **mesh.factors)
            for unit, (name, texture) in enumerate(mesh.textures.items()):
                set_uniforms(self._program, **{name: unit})
                texture.use(unit)
            mesh.array.render()

    def release(self) -> None:
        """Free the GL objects."""
        uploaded = [
            item for mesh in self._meshes for item in (*mesh.textures.values(), *mesh.buffers)
        ]
        release(
            self._context,
            self._framebuffer,
            self._depth,
            *(texture for _, texture in self.textures),
            *(mesh.array for mesh in self._meshes),
            *uploaded,
            self._program,
        )


class _DrawnMesh(NamedTuple):
    array: moderngl.VertexArray
    buffers: tuple[moderngl.Buffer, ...]
    textures: dict[str, moderngl.Texture]
    factors: dict[str, Any]


def _all_meshes(scene: Scene) -> tuple[Mesh, ...]:
    return scene.meshes if scene.ground is None else (*scene.meshes, disc(scene.ground))


def disc(ground: Ground) -> Mesh:
    """Return the ground as a mesh: a regular polygon of 256 sides inside its circle."""
    angle = 2 * math.pi * np.arange(_GROUND_SIDES) / _GROUND_SIDES
    rim = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)
    positions = ground.radius_m * np.vstack([np.zeros(3), rim])
    positions[:, 1] = ground.y_m
    corner = np.arange(_GROUND_SIDES)
    faces = np.stack([np.zeros_like(corner), corner + 1, (corner + 1) % _GROUND_SIDES + 1], -1)
    normals = np.tile([0.0, 1.0, 0.0], (len(positions), 1))
    material = Material(ground.reflectance, roughness=1.0, specular=0.0)
    return Mesh(
        positions.astype(np.float32), normals.astype(np.float32), faces.astype(np.int32), material
    )


def _depth_range(
    points: NDArray[np.float32], near_count: int, camera: Camera
) -> tuple[float, float]:
    """Near and far plane in m: 1 % of the way to what is looked at, and the farthest point.

    That is the target, or the farthest of the first `near_count` points: a target may be far away
    to say no more than which way to look.
    """
    distances_m = np.linalg.norm(points - camera.eye, axis=1)
    target_m = float(np.linalg.norm(camera.target - camera.eye))
    near_m = 0.01 * min(target_m, float(distances_m[:near_count].max()))
    return near_m, 1.01 * float(distances_m.max())


def _upload(context: moderngl.Context, program: moderngl.Program, mesh: Mesh) -> _DrawnMesh:
    material = mesh.material
    count = len(mesh.positions)
    coordinates = mesh.texture_coordinates
    colour = mesh.vertex_colour
    vertices = np.column_stack(
        [
            mesh.positions,
            mesh.normals,
            np.zeros((count, 2)) if coordinates is None else coordinates,
            np.ones((count, 3)) if colour is None else colour,
        ]
    ).astype(np.float32)
    buffer = context.buffer(vertices.tobytes())
    indices = context.buffer(np.ascontiguousarray(mesh.faces).tobytes())
    array = context.vertex_array(
        program,
        [(buffer, "3f 3f 2f 3f", "position", "normal", "texture_coordinate", "vertex_colour")],
        index_buffer=indices,
    )
    factors = {
        "base_colour": material.base_colour,
        "roughness": material.roughness,
        "metalness": material.metalness,
        "specular": material.specular,
    }
    return _DrawnMesh(array, (buffer, indices), _textures(context, material), factors)


def _textures(context: moderngl.Context, material: Material) -> dict[str, moderngl.Texture]:
    """Mipmapped textures of a material; white where it has none."""
    white = np.full((1, 1, 3), 255, np.uint8)
    colour = white if material.base_colour_texture is None else material.base_colour_texture
    factors = material.roughness_metalness_texture
    if factors is None:
        factors = white[..., :2]
    return {
        "base_colour_texture": _texture(context, colour, internal_format=_SRGB8),
        "roughness_metalness_texture": _texture(context, factors),
    }


def _texture(
    context: moderngl.Context, pixels: NDArray[np.uint8], internal_format: int | None = None
) -> moderngl.Texture:
    height, width, channels = pixels.shape
    texture = context.texture(
        (width, height),
        channels,
        np.ascontiguousarray(pixels[::-1]).tobytes(),  # GL's row 0 is at v = 0
        alignment=1,
        internal_format=internal_format,
    )
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
