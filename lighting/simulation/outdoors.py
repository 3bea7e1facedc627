"""A made map that looks like outdoors, where no captured one is at hand."""

import numpy as np

from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions


def outdoors(height: int = 64, seed: int = 0) -> EnvironmentMap:
    """Return blue sky, a warm glow around a low sun, and dark ground that is textured at random.

    Smooth but for the texture. The glow is about 4° wide and 300 times as bright as the sky.
    """
    directions = cell_directions(height)
    elevation = directions[..., 1:2]
    sun = np.array([0.6, 0.5, 0.62])
    cosine = directions @ (sun / np.linalg.norm(sun))
    sky = np.array([0.4, 0.6, 1.0]) * (1.2 - elevation)
    glow = np.array([1.0, 0.8, 0.5]) * (3e2 * np.exp((cosine - 1) * 400))[..., None]
    texture = np.random.default_rng(seed).uniform(0.5, 1.5, (height, 2 * height, 1))
    ground = np.array([0.30, 0.25, 0.18]) * texture
    radiance = np.where(elevation > 0, sky + glow, ground).astype(np.float32)
    seen = np.ones((height, 2 * height), bool)
    return EnvironmentMap(radiance, seen, ~seen)
