"""Reference pictures of scenes under maps, traced once and kept in a folder.

Input  : scenes with cameras, maps; a folder.    Output : cases, each with its Truth.
Cost   : seconds for each, as render/reference; then what it takes to read a file.
"""

from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from capture.errors import InputError
from capture.output import replacing
from lighting.maps.environment import EnvironmentMap
from lighting.measures.known import code_digest
from render.measures.chart import Case
from render.measures.chart_scenes import View, map_digest, view_digest
from render.measures.picture_errors import Truth, away_from_outlines
from render.reference.tracing import render_reference
from render.scenes.scene import Camera, Scene

ERROR = 0.01
"""Relative error that a truth is traced to: it is known, and taken off."""

MOST_SECONDS = 60.0
"""Time after which it is good enough."""

_CODE = tuple(Path(__file__).parents[1] / name for name in ("reference", "rays", "scenes"))


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


def truth_of(scene: Scene, camera: Camera, environment: EnvironmentMap, folder: Path) -> Truth:
    """Return the truth of a scene under a map, from `folder` or traced and put there.

    Raises
    ------
    InputError
        If a file there is damaged.
    """
    name = f"{code_digest(*_CODE)}-{view_digest(scene, camera)}-{map_digest(environment)}"
    path = folder / f"{name}.npz"
    if not path.exists():
        traced = render_reference(scene, camera, environment, error=ERROR, seconds=MOST_SECONDS)
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial, partial.open("wb") as file:
            np.savez(file, radiance=traced.radiance[..., :3], error=traced.standard_error)
    try:
        with path.open("rb") as stored, np.load(stored) as kept:
            radiance, error = kept["radiance"], kept["error"]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as damage:
        raise InputError(f"{path}: not a kept reference picture ({damage}); remove it") from damage
    return Truth(radiance, error, away_from_outlines(scene, camera))
