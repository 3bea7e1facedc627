"""glTF 2.0 scenes: a directional light of KHR_lights_punctual for each light.

Domain : +Y up, metres, as glTF and as our world; linear Rec.709.
A directional light shines along its node's −Z; its intensity is the illuminance on a surface that
faces it, in lux. Radiance that is only relative gives intensities that are only relative: right
among each other and beside the dome, in no unit (Blender's importer then wants its lighting mode
"Unitless"). glTF lights have no size and core glTF has no dome: the radius of each light and the
name of the dome's map, which is in the convention of three.js, are in `extras` for the program that
loads the scene.
Fails  : shadows are hard, whatever the light's radius.

References
----------
.. [1] Khronos Group, KHR_lights_punctual.
"""

import json
import struct
from typing import Any

import numpy as np

from lighting.export.discs import (
    disc_radius_rad,
    facing_irradiance,
    light_names,
    strength_and_colour,
)
from lighting.export.orientation import quaternions
from lighting.export.rig import DomeFile
from lighting.light_set import LightSet

_EXTENSION = "KHR_lights_punctual"


def to_gltf(lights: LightSet, dome: DomeFile | None) -> bytes:
    """Return the lights as a .gltf file (JSON), which names the dome's map beside it."""
    return json.dumps(_scene(lights, dome), indent=1, ensure_ascii=False).encode() + b"\n"


def to_glb(lights: LightSet, dome: DomeFile | None) -> bytes:
    """Return the lights as a .glb file: the same JSON as a binary file's only chunk."""
    content = json.dumps(_scene(lights, dome), ensure_ascii=False).encode()
    content += b" " * (-len(content) % 4)
    chunk = struct.pack("<I4s", len(content), b"JSON") + content
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk


def _scene(lights: LightSet, dome: DomeFile | None) -> dict[str, Any]:
    names = light_names(lights)
    strength, colour = strength_and_colour(facing_irradiance(lights))
    rotations = np.roll(quaternions(lights.directions), -1, axis=1)  # glTF's order is x, y, z, w
    extras = {"scale": lights.scale, "source": lights.source}
    if dome is not None:
        extras |= {"environmentMap": dome.name, "environmentMapConvention": "three"}
    scene: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "fishlight"},
        "scene": 0,
        "scenes": [{"name": "lights", "extras": extras}],
    }
    if len(lights) == 0:  # glTF allows no empty lists
        return scene
    scene["scenes"][0]["nodes"] = list(range(len(lights)))
    scene["nodes"] = [
        {"name": name, "rotation": rotation, "extensions": {_EXTENSION: {"light": index}}}
        for index, (name, rotation) in enumerate(zip(names, rotations.tolist(), strict=True))
    ]
    scene["extensionsUsed"] = [_EXTENSION]
    scene["extensions"] = {
        _EXTENSION: {
            "lights": [
                {
                    "name": name,
                    "type": "directional",
                    "color": rgb,
                    "intensity": intensity,
                    "extras": {"angularRadius": radius},
                }
                for name, rgb, intensity, radius in zip(
                    names,
                    colour.tolist(),
                    strength.tolist(),
                    disc_radius_rad(lights).tolist(),
                    strict=True,
                )
            ]
        }
    }
    return scene
