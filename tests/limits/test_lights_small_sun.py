"""A sun of one cell takes the lights.

Claim    : the inverse CDF gives a source lights in proportion to its power; one that outshines all
           takes all, and surfaces turned away from it stay black under a sky that is not.
Setup    : a sun of one cell, 1e6 above an even sky, on a map of 64 rows: 99.4 % of the light.
Expected : at least ⌊count · share⌋ − 1 lights inside the sun's cell, hence the same shadow over and
           over, whose power is right to 1/count; in its shade the sky is missing or far too bright,
           by no more than 1/count of all the light.
Measured : 16 of 16, 64 of 64, 254 of 256 and 1018 of 1024 lights in the sun's cell; a surface
           that faces away gets 0, 0, 5.8 and 2.7 in place of π.
"""

import numpy as np
import pytest

from lighting.reduce import reduce_to_lights
from lighting.sphere.latlong import cell_directions, direction_to_grid, solid_angles
from tests.environments import irradiance, sun_in_sky

HEIGHT = 64
SUN = (20, 30)


def lights_and_share(count):
    environment = sun_in_sky(HEIGHT, 1e6, SUN)
    lights = reduce_to_lights(environment, count, "inverse-cdf")
    share = 1e6 * solid_angles(HEIGHT)[SUN[0]] / environment.integral()[1]
    cell = np.round(direction_to_grid(lights.directions, HEIGHT))
    in_sun = (cell == (SUN[1], SUN[0])).all(axis=1)
    return lights, share, in_sun


@pytest.mark.parametrize("count", [16, 64, 256, 1024])
def test_the_sun_takes_its_share_of_the_lights(count):
    lights, share, in_sun = lights_and_share(count)
    assert in_sun.sum() >= np.floor(count * share) - 1
    power = lights.irradiance[in_sun, 1].sum() / lights.irradiance[:, 1].sum()
    assert abs(power - share) <= 1 / count


@pytest.mark.parametrize("count", [16, 64, 256, 1024])
def test_in_the_shade_the_error_is_at_most_one_light(count):
    lights, _, _ = lights_and_share(count)
    away = -cell_directions(HEIGHT)[SUN][None]
    measured = irradiance(away, lights.directions, lights.irradiance)[0, 1]
    # The sky gives π to a surface that the sun does not reach.
    assert abs(measured - np.pi) <= 1 / count * lights.irradiance[:, 1].sum()


def test_with_few_lights_the_shade_is_black():
    lights, _, in_sun = lights_and_share(64)
    assert in_sun.all()
    away = -cell_directions(HEIGHT)[SUN][None]
    assert not irradiance(away, lights.directions, lights.irradiance).any()
