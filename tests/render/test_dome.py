"""The dome that stands for a fill: its light, its places, and its irradiance in the open."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from lighting.light_set import LightSet
from lighting.measures.error_measures import received, relative_rms, standard_receivers
from lighting.sphere import harmonics
from render.lights.dome import CELLS, dome_lights
from tests.environments import normals

NO_LIGHTS = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)


def random_fill(seed):
    """A fill as strong in every degree as it can be without being negative."""
    coefficients = np.random.default_rng(seed).normal(size=(9, 3))
    coefficients[0] = np.abs(coefficients[0]) + 1
    return harmonics.windowed(coefficients)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_all_of_the_light_and_the_irradiance_in_the_open(seed):
    fill = random_fill(seed)
    directions, irradiance, radius_rad = dome_lights(fill, upper_only=False)
    assert_allclose(irradiance.sum(axis=0), harmonics.integral(fill), rtol=1e-12)
    dome = LightSet(directions, irradiance, radius_rad)
    in_the_open = received(standard_receivers()["open"], dome)
    exact = harmonics.irradiance(fill, normals())
    assert relative_rms(in_the_open, exact) < 0.002


def test_the_same_places_for_every_fill():
    first, second = (dome_lights(random_fill(seed), upper_only=False) for seed in (1, 2))
    assert_array_equal(first[0], second[0])
    assert_array_equal(first[2], second[2])


def test_over_a_ground_the_upper_half():
    fill = random_fill(3)
    everywhere, upper = (dome_lights(fill, upper_only=only) for only in (False, True))
    above = everywhere[0][:, 1] > 0
    assert above.sum() == CELLS // 2
    for whole, half in zip(everywhere, upper, strict=True):
        assert_array_equal(whole[above], half)


def test_no_disc_straddles_the_horizon():
    directions, _, radius_rad = dome_lights(random_fill(4), upper_only=False)
    assert np.all(np.arcsin(np.abs(directions[:, 1])) >= radius_rad - 1e-12)


@pytest.mark.parametrize(("kind", "bound"), [("wall", 0.02), ("sphere", 0.015)])
def test_extents_carry_the_fill_around_occluders(kind, bound):
    # What a renderer with soft shadows would make of the dome; as points over twice as much.
    fill = random_fill(5)
    receivers = standard_receivers()[kind]
    exact = received(receivers, LightSet(*NO_LIGHTS, fill=fill))
    dome = LightSet(*dome_lights(fill, upper_only=False))
    assert relative_rms(received(receivers, dome), exact) < bound
    assert relative_rms(received(receivers, dome, as_points=True), exact) > 2 * bound
