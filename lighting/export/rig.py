"""What is exported: distant lights, and a dome that holds the light beside them.

Input  : a light set, and the map it comes from if there is one.
Output : a LightRig, whose lights and dome together are the map, and count nothing twice.
Other programs take a light as a uniform disc. One wider than a hemisphere, which stands for most of
a map, becomes a hemisphere of the same ∫ L dω.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting import harmonics
from lighting.environment import EnvironmentMap
from lighting.latlong import cell_directions
from lighting.light_set import LightSet
from lighting.residual import remove_lights

_FILL_ROWS = 64  # the midpoints of its cells lose 1e-4 of a function of order 2


@dataclass(frozen=True, eq=False)
class LightRig:
    """Lights, and the environment map beside them.

    Attributes
    ----------
    lights : LightSet
        Those that are written; without fill, which is in the dome.
    dome : EnvironmentMap or None
        On our grid and in our orientation; None if lights are all there is.
    missing : (3,) float64
        ∫ L dω of the lights that the map did not have where they stand: by so much lights and dome
        together exceed the map. 0 without a map.
    """

    lights: LightSet
    dome: EnvironmentMap | None
    missing: NDArray[np.float64]


class DomeFile(NamedTuple):
    """The map of a dome on disk: its name, in the scene's folder, and its rows."""

    name: str
    height: int


def light_rig(lights: LightSet, environment: EnvironmentMap | None = None) -> LightRig:
    """Return the key lights and the map without them, or all lights and their fill.

    The first where there are a map and key lights, the second everywhere else.

    Raises
    ------
    InputError
        If map and lights do not have the same scale.
    """
    if environment is not None and environment.scale != lights.scale:
        raise InputError(
            f"the map's scale is {environment.scale}, the lights' is {lights.scale}: "
            "lights and map must come from the same picture"
        )
    if environment is not None and lights.is_key.any():
        keys = _without_fill(lights, lights.is_key)
        residual, removed = remove_lights(environment, keys)
        return LightRig(keys, residual, (keys.irradiance - removed).sum(axis=0))
    everything = np.ones(len(lights), np.bool_)
    dome = _dome_of_fill(lights) if lights.fill.any() else None
    return LightRig(_without_fill(lights, everything), dome, np.zeros(3))


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


def _without_fill(lights: LightSet, chosen: NDArray[np.bool_]) -> LightSet:
    return replace(
        lights,
        directions=lights.directions[chosen],
        irradiance=lights.irradiance[chosen],
        angular_radius_rad=lights.angular_radius_rad[chosen],
        is_key=lights.is_key[chosen],
        fill=np.zeros_like(lights.fill),
    )


def _dome_of_fill(lights: LightSet) -> EnvironmentMap:
    radiance = harmonics.evaluate(lights.fill, cell_directions(_FILL_ROWS)).clip(min=0)
    seen = np.ones(radiance.shape[:2], np.bool_)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen, lights.scale)
