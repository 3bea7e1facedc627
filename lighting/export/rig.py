"""What is exported: distant lights, and a dome that holds the light beside them.

Input  : a light set, and the map it comes from if there is one.
Output : a LightRig, whose lights and dome together are the map, and count nothing twice.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.export.residual import remove_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions

_FILL_ROWS = 64  # the midpoints of its cells lose 1e-4 of a function of order 2


@dataclass(frozen=True, eq=False)
class LightRig:
    """Lights, and the environment map beside them.

    Attributes
    ----------
    lights : LightSet
        Those that are written, all with some light; without fill, which is in the dome.
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

    The first where there are a map and key lights, the second everywhere else. Lights without
    irradiance, which fading ones leave (temporal.py), are left out.

    Raises
    ------
    InputError
        If map and lights do not have the same scale.
    """
    if environment is not None and environment.scale != lights.scale:
        raise InputError(
            f"the map's scale is {environment.scale!r}, the lights' is {lights.scale!r}: "
            "lights and map must come from the same picture"
        )
    is_lit = lights.irradiance.max(axis=1) > 0
    is_lit_key = lights.is_key & is_lit
    if environment is not None and is_lit_key.any():
        keys = _without_fill(lights, is_lit_key)
        residual, removed = remove_lights(environment, keys)
        return LightRig(keys, residual, (keys.irradiance - removed).sum(axis=0))
    dome = _dome_of_fill(lights) if lights.fill.any() else None
    return LightRig(_without_fill(lights, is_lit), dome, np.zeros(3))


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
