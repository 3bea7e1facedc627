"""What estimators are compared on: three scenes of one shape."""

from collections.abc import Callable
from dataclasses import replace

from render.measures.chart_scenes import View
from render.scenes.default_scene import default_scene
from render.scenes.scene import Material, Scene


def comparison_scenes(size_px: tuple[int, int]) -> dict[str, View]:
    """Return one view of three objects on a matt ground: matt, glossy, and one of each."""
    scene, camera = default_scene(size_px)
    return {
        "diffuse": (_made_of(scene, _matt), camera),
        "glossy": (_made_of(scene, _glossy), camera),
        "mixed": (scene, camera),
    }


def _made_of(scene: Scene, material_of: Callable[[Material], Material]) -> Scene:
    meshes = (replace(mesh, material=material_of(mesh.material)) for mesh in scene.meshes)
    return replace(scene, meshes=tuple(meshes))


def _matt(material: Material) -> Material:
    return Material(material.base_colour, specular=0.0)


def _glossy(material: Material) -> Material:
    return Material(material.base_colour, roughness=0.25, metalness=1.0)
