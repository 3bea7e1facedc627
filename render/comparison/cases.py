"""What estimators are compared on: three scenes under maps, and the truth of each.

Input  : a size; maps by name.    Output : cases.
Cost   : the truth of a case takes seconds, when it is first asked for.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from lighting.maps.environment import EnvironmentMap
from render.measures.chart import Case
from render.measures.chart_scenes import View
from render.measures.truths import truth_of
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


def cases_of(
    scenes: Mapping[str, View], maps: Mapping[str, EnvironmentMap], folder: Path
) -> list[Case]:
    """Return every scene under every map; truths are kept in `folder`."""
    return [
        Case(
            scene_name,
            map_name,
            scene,
            camera,
            environment,
            cache(partial(truth_of, scene, camera, environment, folder)),
        )
        for map_name, environment in maps.items()
        for scene_name, (scene, camera) in scenes.items()
    ]


def _made_of(scene: Scene, material_of: Callable[[Material], Material]) -> Scene:
    meshes = (replace(mesh, material=material_of(mesh.material)) for mesh in scene.meshes)
    return replace(scene, meshes=tuple(meshes))


def _matt(material: Material) -> Material:
    return Material(material.base_colour, specular=0.0)


def _glossy(material: Material) -> Material:
    return Material(material.base_colour, roughness=0.25, metalness=1.0)
