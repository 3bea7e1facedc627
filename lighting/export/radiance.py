"""Radiance scenes (.rad): a `source` of `light` for each light, a glowing sky for the map.

Domain : Radiance's usual world, +Z up: our (x, y, z) is its (x, −z, y), so that our +X is its east
and our −Z its north. Colours are radiance, in W/(sr m²) once an absolute calibration was given.
A `source` has a full angle in degrees. The sky is a `colorpict` around the whole sphere, whose
picture, in our orientation, is looked up by the ray's direction. It glows and is not sampled as a
lamp: it reaches surfaces by the ambient calculation (rtrace -ab 1 or more).
Fails  : a `source` must have a size: a point becomes a disc of 0.1°. Radiance takes all of a disc's
         light from its centre (1 % too much from a disc of radius 0.2 rad) and loses the sky behind
         it. It adds half a step to the picture's 8 bits (0.3 %). It looks for the picture in the
         folder where it is started, and on RAYPATH.

References
----------
.. [1] "The RADIANCE 5 Synthetic Imaging System" (ray.html): source, light, glow, colorpict.
"""

import numpy as np

from lighting.export.discs import about, disc_radius_rad, light_names
from lighting.export.orientation import z_up
from lighting.export.rig import DomeFile
from lighting.light_set import LightSet

_LEAST_RADIUS_RAD = np.radians(0.05)

# With d = (Dx, Dz, −Dy) in our frame, CONVENTIONS.md section 3 has φ = atan2(Dx, −Dy). Radiance
# interpolates from the first pixel's centre at 0 to the last one's at 2, or at 1 from the bottom to
# the top; bound() holds the half cells beyond.
_DOME = """
void colorpict dome_map
7 red green blue "{name}" .
bound(0,({columns}*(1-atan2(Dx,-Dy)/PI)-1)/({columns}-1),2)
bound(0,1-({rows}*Acos(Dz)/PI-0.5)/({rows}-1),1)
0
0

dome_map glow dome_glow
0
0
4 1 1 1 0

dome_glow source dome
0
0
4 0 0 1 360
"""


def to_radiance(lights: LightSet, dome: DomeFile | None) -> bytes:
    """Return the lights as a .rad file, with a sky from the picture of the dome beside it."""
    radius = np.maximum(disc_radius_rad(lights), _LEAST_RADIUS_RAD)
    solid_angle = 2 * np.pi * (1 - np.cos(radius))
    parts = [f"# {about(lights)}\n"]
    parts += [
        f"""
void light {name}_radiance
0
0
3 {_numbers(rgb)}

{name}_radiance source {name}
0
0
4 {_numbers(direction)} {angle:.9g}
"""
        for name, rgb, direction, angle in zip(
            light_names(lights),
            lights.irradiance / solid_angle[:, None],
            z_up(lights.directions),
            np.degrees(2 * radius),
            strict=True,
        )
    ]
    if dome is not None:
        parts.append(_DOME.format(name=dome.name, columns=2 * dome.height, rows=dome.height))
    return "".join(parts).encode()


def _numbers(values: np.typing.NDArray[np.float64]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
