"""Radiance scenes (.rad): a `source` of `light` for each light, a glowing sky for the map.

Domain : Radiance's usual world, +Z up: our (x, y, z) is its (x, −z, y), so that our +X is its east
and our −Z its north. Colours are radiance, in W/(sr m²) once an absolute calibration was given.
A `source` has a full angle in degrees. The sky is a `colorpict` around the whole sphere, whose
picture, in our orientation, is looked up by the ray's direction; its shorter side is 1 long and its
origin is at the lower left. It glows and is not sampled as a lamp: it reaches surfaces by the
ambient calculation (rtrace -ab 1 or more).
Fails  : a `source` must have a size: a point becomes a disc of 0.1°. Radiance looks for the picture
         in the folder where it is started, and on RAYPATH.

References
----------
.. [1] "The RADIANCE 5 Synthetic Imaging System" (ray.html): source, light, glow, colorpict.
"""

import numpy as np

from lighting.export.orientation import z_up
from lighting.export.rig import disc_radius_rad, light_names
from lighting.light_set import LightSet

_LEAST_RADIUS_RAD = np.radians(0.05)

# With d = (Dx, Dz, −Dy) in our frame, CONVENTIONS.md section 3 has φ = atan2(Dx, −Dy), and the map
# spans 2 to the right and 1 up. The pixels are interpolated, and beyond the outer centres
# extrapolated: noneg() keeps that from being negative.
_DOME = """
void colorpict dome_map
7 noneg noneg noneg "{name}" . 1-atan2(Dx,-Dy)/PI 1-Acos(Dz)/PI
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


def to_radiance(lights: LightSet, dome_name: str | None) -> bytes:
    """Return the lights as a .rad file, with a sky from the picture `dome_name` beside it."""
    radius = np.maximum(disc_radius_rad(lights), _LEAST_RADIUS_RAD)
    solid_angle = 2 * np.pi * (1 - np.cos(radius))
    parts = [f"# lights by fishlight, radiance {lights.scale}: {' '.join(lights.source.split())}\n"]
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
    if dome_name is not None:
        parts.append(_DOME.format(name=dome_name))
    return "".join(parts).encode()


def _numbers(values: np.typing.NDArray[np.float64]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
