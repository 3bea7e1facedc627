"""Which lights of a set reach a scene, and as what."""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from render.lights.discs import cut_at_horizon
from render.lights.gathered_parts import gathered_parts
from render.scenes.scene import Scene


def reaching_lights(
    lights: LightSet, scene: Scene
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return direction, irradiance and angular radius of the lights that reach the scene.

    Left out are lights without power, and over a ground what is below its horizon, of a disc that
    straddles it the part below: the ground is opaque, and everything stands on it. A light of more
    than a hemisphere becomes one of a hemisphere, and parts of one small source become one light.
    """
    keep = np.any(lights.irradiance > 0, axis=1)
    radius_rad = np.minimum(lights.angular_radius_rad[keep], 0.5 * np.pi)
    reaching = gathered_parts(lights.directions[keep], lights.irradiance[keep], radius_rad)
    return reaching if scene.ground is None else cut_at_horizon(*reaching)
