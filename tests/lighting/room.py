"""A room for the export's tests: no two of its sides look alike, and two lamps shine in it."""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import environment, true_irradiance

Array = NDArray[np.float64]

LAMPS = (
    ((0.6, 0.5, 0.62), 0.08, (60.0, 45.0, 30.0)),
    ((-0.7, 0.3, 0.2), 0.12, (4.0, 12.0, 16.0)),
)
"""Direction, radius and radiance above the wall's."""

_WALLS = np.array([[0.3, -0.5, 0.2], [0.8, 0.5, -0.4], [-0.2, 0.1, 0.9]])


def room(height: int = 64) -> EnvironmentMap:
    """Return walls of 0.05 to 0.4 in all colours, with the lamps on them."""
    directions = cell_directions(height)
    radiance = 0.22 + 0.2 * np.tanh(directions @ _WALLS.T)
    for direction, radius, rgb in LAMPS:
        radiance += _disc(directions, direction, radius)[..., None] * np.array(rgb)
    return environment(radiance)


def lamps(height: int = 64) -> LightSet:
    """Return the lamps of the room on its map's grid as key lights, and a light that is none."""
    directions, solid_angle = cell_directions(height), solid_angles(height)[:, None]
    centres, irradiance = [], []
    for direction, radius, rgb in LAMPS:
        weight = solid_angle * _disc(directions, direction, radius)
        centres.append(np.einsum("rc,rck->k", weight, directions))
        irradiance.append(weight.sum() * np.array(rgb))
    centres.append(np.array([0.0, -1.0, 0.0]))
    irradiance.append(np.ones(3))
    return LightSet(
        np.array([centre / np.linalg.norm(centre) for centre in centres]),
        np.array(irradiance),
        np.array([*(radius for _, radius, _ in LAMPS), 0.5]),
        is_key=np.array([True, True, False]),
        source="the room",
    )


def error_of(towards: Array, measured: Array) -> float:
    """Return the rms error of an irradiance (n, 3) measured in the room, by its rms."""
    expected = true_irradiance(towards, room())
    return float(np.sqrt(np.mean((measured - expected) ** 2) / np.mean(expected**2)))


def assert_lit_by_the_room(towards: Array, measured: Array, tolerance: float) -> None:
    """Check an irradiance (n, 3) that a program found on surfaces of normals (n, 3) in our frame.

    Turned by a quarter or a half, or mirrored, it must fail, or the check would prove nothing.
    """
    x, y, z = towards.T
    for wrong in ((-x, y, z), (x, y, -z), (x, -y, z), (z, y, -x), (-z, y, x), (-x, y, -z)):
        assert error_of(np.stack(wrong, axis=-1), measured) > 0.1
    assert error_of(towards, measured) < tolerance


def _disc(directions: Array, centre: tuple[float, float, float], radius: float) -> Array:
    return directions @ np.array(centre) > np.cos(radius) * np.linalg.norm(centre)
