"""USD scenes as text (.usda): a DistantLight for each light, a DomeLight for the map.

Domain : stage with +Y up, metres; linear Rec.709 in whatever unit the lights have.
UsdLux normalises a DistantLight such that `intensity` is the illuminance on a surface that faces
it, whatever its `angle`: L = intensity / (π sin² θ), θ half the angle, which is a full diameter in
degrees; a light of angle 0 gives its intensity. It shines along its own −Z. A DomeLight's texture
is oriented as OpenEXR's lat-long maps, which is our orientation.
Fails  : renderers older than the specification [1] normalise in ways of their own. Blender 4.5
         reads (and writes) the angle as a radius and multiplies the intensity by 4: for Blender,
         export a script.

References
----------
.. [1] OpenUSD, schemas of UsdLux, pxr/usd/usdLux/schema.usda: `inputs:normalize` of LightAPI,
       DistantLight, DomeLight.
"""

import json

import numpy as np

from lighting.export.discs import (
    about,
    disc_radius_rad,
    facing_irradiance,
    light_names,
    strength_and_colour,
)
from lighting.export.orientation import quaternions
from lighting.export.rig import DomeFile
from lighting.light_set import LightSet


def to_usda(lights: LightSet, dome: DomeFile | None) -> bytes:
    """Return the lights as a .usda file, with a DomeLight of the map beside it."""
    strength, colour = strength_and_colour(facing_irradiance(lights))
    prims = [
        f'''
    def DistantLight "{name}"
    {{
        float inputs:angle = {np.degrees(2 * radius):.9g}
        color3f inputs:color = {_tuple(rgb)}
        float inputs:intensity = {intensity:.9g}
        bool inputs:normalize = true
        quatd xformOp:orient = {_tuple(turn)}
        uniform token[] xformOpOrder = ["xformOp:orient"]
    }}
'''
        for name, radius, rgb, intensity, turn in zip(
            light_names(lights),
            disc_radius_rad(lights),
            colour,
            strength,
            quaternions(lights.directions),
            strict=True,
        )
    ]
    if dome is not None:
        prims.append(f"""
    def DomeLight "dome"
    {{
        asset inputs:texture:file = @./{dome.name}@
        token inputs:texture:format = "latlong"
    }}
""")
    text = f"""#usda 1.0
(
    defaultPrim = "lights"
    doc = {json.dumps(about(lights), ensure_ascii=False)}
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "lights"
{{{"".join(prims)}}}
"""
    return text.encode()


def _tuple(values: np.typing.NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.17g}" for value in values) + ")"
