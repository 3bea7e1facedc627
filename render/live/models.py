"""What can stand in the light: a few shapes, the meshes named at the start, and their materials.

Names are all that a viewer chooses by: no path ever comes from it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from capture.errors import InputError
from render.live.settings import Settings
from render.scenes.default_scene import default_scene, frame_meshes, sphere, torus
from render.scenes.mesh import load_meshes
from render.scenes.scene import Camera, Material, Mesh, Scene

OWN = "own"
OBJECTS = "objects"

_MATT_WHITE = Material((0.8, 0.8, 0.8), roughness=1.0, specular=0.0)

MATERIALS: dict[str, Material | None] = {
    OWN: None,
    "matt white": _MATT_WHITE,
    "grey card": Material((0.18, 0.18, 0.18), roughness=1.0, specular=0.0),
    "clay": Material((0.55, 0.22, 0.12), roughness=0.5),
    "brushed metal": Material((0.95, 0.93, 0.88), roughness=0.35, metalness=1.0),
    "gold": Material((1.0, 0.77, 0.34), roughness=0.3, metalness=1.0),
}
"""None keeps what each mesh was made with."""

_SHAPES: dict[str, Callable[[], tuple[Mesh, ...]]] = {
    OBJECTS: lambda: default_scene()[0].meshes,
    "sphere": lambda: (sphere((0.0, 0.5, 0.0), 0.5, _MATT_WHITE),),
    "ring": lambda: (torus((0.0, 0.75, 0.0), 0.6, 0.15, _MATT_WHITE),),
}


@dataclass(frozen=True)
class Models:
    """The models of a session by name, in the order in which they are offered.

    `notes` tells what their files hold that is not shown.
    """

    meshes: dict[str, tuple[Mesh, ...]]
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names to choose from."""
        return tuple(self.meshes)

    def check(self, settings: Settings) -> None:
        """Raise InputError unless the settings name a model and a material that there are."""
        for kind, name, known in (
            ("model", settings.model, self.meshes),
            ("material", settings.material, MATERIALS),
        ):
            if name not in known:
                raise InputError(f"not changed: no {kind} is called {name!r}")

    def view(self, settings: Settings, size_px: tuple[int, int]) -> tuple[Scene, Camera]:
        """Return the scene that the settings name, and the camera they put before it."""
        meshes = self.meshes[settings.model]
        material = MATERIALS[settings.material]
        if material is not None:
            meshes = tuple(replace(mesh, material=material) for mesh in meshes)
        scene, framing = frame_meshes(meshes, size_px, settings.azimuth_rad)
        back = framing.eye - framing.target
        distance_m = settings.distance * math.hypot(*back)
        level = math.hypot(back[0], back[2])
        direction = back / level * math.cos(settings.elevation_rad)
        direction[1] = math.sin(settings.elevation_rad)
        eye = framing.target + distance_m * direction
        return scene, replace(framing, eye=eye)


def load_models(paths: Sequence[Path]) -> Models:
    """Return the shapes and the meshes of files, which are called by their names.

    Raises
    ------
    InputError
        If a file cannot be read, or two have the same name.
    """
    meshes: dict[str, tuple[Mesh, ...]] = {}
    notes: list[str] = []
    for path in paths:
        if path.stem in meshes or path.stem in _SHAPES:
            raise InputError(f"{path}: another model is called {path.stem}; rename the file")
        model = load_meshes(path)
        meshes[path.stem] = model.meshes
        notes += model.notes
    return Models(meshes | {name: make() for name, make in _SHAPES.items()}, tuple(notes))
