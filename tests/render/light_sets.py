"""Sets of lights for tests."""

import numpy as np

from lighting.light_set import LightSet


def one_light(direction, irradiance=(1.0, 1.0, 1.0), angular_radius_rad=0.0):
    direction = np.asarray(direction, float)
    return LightSet(
        direction[None] / np.linalg.norm(direction),
        np.asarray(irradiance, float)[None],
        np.array([angular_radius_rad]),
    )


def random_lights(count, seed, lowest=0.05):
    """Coloured point lights above the horizon by at least `lowest` (sine)."""
    rng = np.random.default_rng(seed)
    y = rng.uniform(lowest, 1.0, count)
    phi = rng.uniform(0, 2 * np.pi, count)
    level = np.sqrt(1 - y**2)
    directions = np.stack([level * np.cos(phi), y, level * np.sin(phi)], axis=-1)
    return LightSet(directions, rng.uniform(0.1, 1.0, (count, 3)), np.zeros(count))


def uniform_lights(count):
    """Point lights of radiance 1 from everywhere: a Fibonacci lattice of equal solid angles."""
    index = np.arange(count) + 0.5
    y = 1 - 2 * index / count
    phi = np.pi * (1 + 5**0.5) * index
    level = np.sqrt(1 - y**2)
    directions = np.stack([level * np.cos(phi), y, level * np.sin(phi)], axis=-1)
    return LightSet(directions, np.full((count, 3), 4 * np.pi / count), np.zeros(count))


def uniform_fill(radiance):
    """Grey of this radiance from everywhere, (9, 3)."""
    fill = np.zeros((9, 3))
    fill[0] = radiance * np.sqrt(4 * np.pi)
    return fill


def only_fill(fill):
    return LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), fill=fill)


def selected(lights, indices):
    return LightSet(
        lights.directions[indices], lights.irradiance[indices], lights.angular_radius_rad[indices]
    )


def scaled(lights, factor):
    return LightSet(lights.directions, factor * lights.irradiance, lights.angular_radius_rad)
