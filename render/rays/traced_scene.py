"""A scene that rays are traced in: its triangles' hierarchy and the tables of what they look like.

Input  : a scene; then others.    Output : what a camera sees of it; addresses for kernels.
Cost   : see embree.py and triangle_tables.py; after a move 2 ms per 70,000 triangles.
"""

import numpy as np
from numpy.typing import NDArray

from render.rays.embree import Occluders, intersect16_address
from render.rays.first_hits import find_surfaces
from render.scenes.scene import Camera, Ground, Scene
from render.scenes.triangle_tables import gather_appearance, gather_geometry

_FLOATS = NDArray[np.float32]

OFFSET = 1e-4
"""Of the triangles' radius: how far off a surface rays from it start."""


class TracedScene:
    """A scene as kernels trace it. Owns Embree's memory until `release`.

    Attributes
    ----------
    scene : Scene
    geometry : Geometry
    sphere : (4,) float32
        Centre and radius of a sphere around all triangles.
    """

    def __init__(self, scene: Scene) -> None:
        self._appearance = gather_appearance([mesh.material for mesh in scene.meshes])
        self._set(scene, is_quick=False)

    @property
    def address(self) -> int:
        """What kernels pass on to Embree; good until the scene moves."""
        return self._occluders.address

    @property
    def offset_m(self) -> float:
        """How far off a surface rays from it start."""
        return OFFSET * self.geometry.radius_m

    def release(self) -> None:
        """Free Embree's memory."""
        self._occluders.release()

    def move(self, scene: Scene) -> None:
        """Trace another scene from now on; materials that stay the same are not read again."""
        if scene is self.scene:
            return
        materials = [mesh.material for mesh in scene.meshes]
        before = [mesh.material for mesh in self.scene.meshes]
        if len(materials) != len(before) or any(
            new is not old for new, old in zip(materials, before, strict=True)
        ):
            self._appearance = gather_appearance(materials)
        freed = self._occluders
        self._set(scene, is_quick=True)
        freed.release()

    def find_surfaces(self, camera: Camera, size_px: tuple[int, int], surfaces: _FLOATS) -> None:
        """Fill `surfaces`, of `empty_surfaces`, with what a picture (width, height) shows."""
        geometry, look = self.geometry, self._appearance
        find_surfaces(
            intersect16_address(), self.address, self.sphere, _view(camera, size_px),
            _level(self.scene.ground), geometry.positions, geometry.attributes, geometry.faces,
            geometry.mesh_of_face, look.factors, look.textures, look.texels, surfaces,
        )  # fmt: skip

    def _set(self, scene: Scene, *, is_quick: bool) -> None:
        geometry = gather_geometry(scene.meshes)
        self._occluders = Occluders(geometry.positions, geometry.faces, is_quick=is_quick)
        self.scene, self.geometry = scene, geometry
        self.sphere = np.array([*geometry.centre, geometry.radius_m], np.float32)


def _view(camera: Camera, size_px: tuple[int, int]) -> _FLOATS:
    """Return the eye, and what a column, a row and 1 add to a ray's direction, (4, 3)."""
    width, height = size_px
    across, up = camera.half_extent()
    right, upward, backward = camera.axes()
    first = (1 / width - 1) * across * right + (1 - 1 / height) * up * upward - backward
    view = [camera.eye, 2 * across / width * right, -2 * up / height * upward, first]
    return np.array(view, np.float32)


def _level(ground: Ground | None) -> _FLOATS:
    """Return the height, radius (negative without a ground) and ρ/π of a ground, (5,)."""
    if ground is None:
        return np.array([0, -1, 0, 0, 0], np.float32)
    return np.array(
        [ground.y_m, ground.radius_m, *(np.asarray(ground.reflectance) / np.pi)], np.float32
    )
