"""What other programs are told of a light: a uniform disc at infinity.

Input  : a light set.    Output : each disc's radius, its irradiance as renderers mean it, a name;
a line about the set.
A light wider than a hemisphere, which stands for most of a map, becomes a hemisphere of the same
∫ L dω.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet


def disc_radius_rad(lights: LightSet) -> NDArray[np.float64]:
    """Return the radius of the disc that each light is written as, (K,), at most π/2."""
    return np.minimum(lights.angular_radius_rad, np.pi / 2)


def facing_irradiance(lights: LightSet) -> NDArray[np.float64]:
    """Return the irradiance (K, 3) of each light's disc on a surface that faces its centre.

    The light is ∫ L dω; at the disc's edge it comes in at an angle. A uniform disc of radius a
    gives ∫ L cos dω = π sin² a L = ∫ L dω (1 + cos a)/2, which is what renderers mean by the
    irradiance or illuminance of a sun.
    """
    return lights.irradiance * (0.5 * (1 + np.cos(disc_radius_rad(lights))))[:, None]


def strength_and_colour(
    rgb: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the greatest channel (K,) of (K, 3), and the colour that it multiplies, 0 to 1."""
    strength = rgb.max(axis=1)
    return strength, rgb / np.where(strength > 0, strength, 1.0)[:, None]


def light_names(lights: LightSet) -> list[str]:
    """Return a name for each light, `key_0` or `light_0` by its kind, fit for every format."""
    return [f"{'key' if key else 'light'}_{i}" for i, key in enumerate(lights.is_key)]


def about(lights: LightSet) -> str:
    """Return a line on what the lights are, fit for a comment.

    Scale and source may hold anything that a file of somebody else did: a line break would end the
    comment, and in a Radiance scene a line after it could be a command.
    """
    text = f"lights by fishlight, radiance {lights.scale}: {lights.source}"
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
