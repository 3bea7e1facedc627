"""All lights of a set as discs, its fill among them, and what they give level ground."""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from render.lights.discs import irradiance_curves
from render.lights.dome import dome_lights
from render.lights.reaching_lights import reaching_lights
from render.scenes.scene import Scene

Array = NDArray[np.float64]


def all_lights(lights: LightSet, scene: Scene) -> tuple[Array, Array, Array]:
    """Return direction (K, 3), irradiance (K, 3) and angular radius (K,) of what lights a scene.

    Those of `reaching_lights`, and a dome for the fill; a dark one if there is none.
    """
    parts = [reaching_lights(lights, scene)]
    if lights.fill.any():
        parts.append(dome_lights(lights.fill, upper_only=scene.ground is not None))
    directions, irradiance, radius_rad = (np.concatenate(each) for each in zip(*parts, strict=True))
    if len(directions) == 0:  # kernels want one
        return np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3)), np.zeros(1)
    return directions, irradiance, radius_rad


def level_irradiance(directions: Array, irradiance: Array, radius_rad: Array) -> Array:
    """Return the irradiance (3,) of level ground without shadow, by discs above its horizon."""
    return np.asarray(
        (2 * irradiance_curves(radius_rad)[:, 0] * directions[:, 1]) @ irradiance, np.float64
    )


def unshaded_ground(
    scene: Scene, directions: Array, irradiance: Array, radius_rad: Array
) -> NDArray[np.float32]:
    """Return the radiance (3,) of a scene's ground where nothing shades it; 0 without a ground."""
    if scene.ground is None:
        return np.zeros(3, np.float32)
    received = level_irradiance(directions, irradiance, radius_rad)
    return (received * scene.ground.reflectance / np.pi).astype(np.float32)
