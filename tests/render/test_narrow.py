"""Which narrow lights are traced, and when: a light that moves on is not."""

from types import SimpleNamespace

import numpy as np
import pytest

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.baked.narrow import STANDING, NarrowLights
from render.lights.discs import Discs
from render.lights.narrow_lights import NARROW_LIGHTS, narrow_lights
from tests.render.light_sets import random_lights


def discs(*azimuths_rad, radius_rad=0.02):
    turn = np.array(azimuths_rad)
    directions = np.stack([np.sin(turn), np.ones_like(turn), np.cos(turn)], -1) / np.sqrt(2)
    white = np.ones((len(turn), 3))
    return Discs(directions, white, np.full(len(turn), radius_rad), white)


@pytest.fixture
def traced():
    return []


@pytest.fixture
def lights(traced):
    def trace(direction, radius_rad):
        traced.append(round(float(np.arctan2(direction[0], direction[2])), 3))
        return f"light {len(traced)}"

    remembered = NarrowLights()
    return SimpleNamespace(follow=lambda discs: remembered.follow(discs, trace))


def test_all_lights_of_the_first_picture_are_traced(lights, traced):
    found, moving = lights.follow(discs(0.1, 0.8))
    assert found == ["light 1", "light 2"]
    assert not moving.any()
    assert traced == [0.1, 0.8]


def test_one_that_moves_on_is_never_traced(lights, traced):
    lights.follow(discs(0.0))
    for step in range(1, 20):
        found, moving = lights.follow(discs(0.1 * step))
        assert found == []
        assert moving.all()
    assert traced == [0.0]


@pytest.mark.parametrize(("step_rad", "times"), [(0.002, 0), (0.0002, 2)])
def test_one_that_moves_slowly_is_traced_if_that_serves_a_dozen_pictures(
    lights, traced, step_rad, times
):
    """What is traced serves for 0.005 rad, a quarter of its radius, here by an angle × sin 45°."""
    lights.follow(discs(0.0))
    for picture in range(1, 60):
        lights.follow(discs(1.0 + step_rad * picture))
    assert len(traced) == 1 + times


def test_one_that_has_come_to_stand_is_traced_once(lights, traced):
    lights.follow(discs(0.0))
    seen = [lights.follow(discs(1.0))[0] for _ in range(STANDING + 3)]
    assert seen == [[]] * (STANDING - 1) + [["light 2"]] * 4
    assert traced == [0.0, 1.0]


def test_of_several_that_come_to_stand_one_is_traced_in_a_picture(lights, traced):
    lights.follow(discs(0.0))
    counts = [len(lights.follow(discs(1.0, 2.0, 3.0))[0]) for _ in range(STANDING + 3)]
    assert counts == [0] * (STANDING - 1) + [1, 2, 3, 3]


def test_what_is_traced_serves_a_quarter_of_the_radius_around(lights, traced):
    lights.follow(discs(0.0))
    assert lights.follow(discs(0.006))[0]
    assert not lights.follow(discs(0.008))[0]
    assert traced == [0.0]


def test_only_the_strongest_are_narrow():
    many = random_lights(30, seed=1)
    chosen = narrow_lights(many.irradiance, many.angular_radius_rad, 0.1)
    order = np.argsort(-(many.irradiance @ LUMINANCE_WEIGHTS))
    assert set(np.flatnonzero(chosen)) == set(order[:NARROW_LIGHTS])


def test_weak_and_wide_lights_are_not_narrow():
    irradiance = np.array([1.0, 1.0, 0.01])[:, None] * np.ones(3)
    chosen = narrow_lights(irradiance, np.array([0.05, 0.2, 0.05]), 0.1)
    assert list(chosen) == [True, False, False]
