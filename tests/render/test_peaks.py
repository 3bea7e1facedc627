"""Which lights smooth surfaces mirror by themselves."""

import numpy as np

from lighting.maps.environment import EnvironmentMap
from render.lights.discs import Discs
from render.lights.narrow_lights import PEAK_RAD
from render.lights.peaks import without_peaks


def mirrored(power, radius_deg):
    """Return whether lights are peaks: each has its own light in a map, all far apart."""
    count = len(power)
    turn = 2 * np.pi * np.arange(count) / count
    directions = np.stack([np.sin(turn), np.zeros(count), np.cos(turn)], axis=-1)
    irradiance = np.repeat(np.asarray(power, float)[:, None], 3, axis=1)
    seen = np.ones((64, 128), bool)
    environment = EnvironmentMap(np.full((64, 128, 3), 10.0, np.float32), seen, ~seen)
    lights = Discs(directions, irradiance, np.radians(radius_deg), irradiance)
    rest, found = without_peaks(environment, lights)
    assert (rest.radiance.min() < 10) == bool(found.mirrored.any())
    return found.mirrored.any(axis=1).tolist()


def test_a_lamp_is_a_peak_however_many_stronger_lights_there_are():
    assert mirrored([*[1.0] * 10, 0.05], [*[20.0] * 10, 1.0]) == [*[False] * 10, True]


def test_a_cell_of_a_sky_is_none_though_it_is_narrow():
    """Nor is one of many lights of no size, which may stand for any part of it."""
    narrow = 0.9 * np.degrees(PEAK_RAD)
    assert not any(mirrored([1.0] * 250, [narrow] * 250))
    assert not any(mirrored([1.0] * 250, [0.0] * 250))


def test_a_strong_light_of_no_size_is_a_peak():
    assert mirrored([1.0, 1.0, 1.0], [20.0, 0.0, 20.0]) == [False, True, False]
