"""Mixtures of lights: light is kept, places are kept, and few lights fade at a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.light_set import LightSet
from lighting.maps.environment import luminance
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.stream.mixing import MOST_FADING, mixed
from tests.lighting_sets import assert_same_lights, random_set, towards

SHARES = st.sampled_from([0.0, 0.01, 0.2, 0.7, 1.0])
SEEDS = st.integers(0, 2**32 - 1)


def two_sets(seed, most=12):
    random = np.random.default_rng(seed)
    return random_set(random, random.integers(0, most)), random_set(
        random, random.integers(0, most)
    )


@settings(deadline=None, max_examples=100)
@given(seed=SEEDS, share=SHARES)
def test_light_is_the_share_of_each(seed, share):
    last, new = two_sets(seed)
    (_, irradiance, _, _), left_over = mixed(last, new, share)
    expected = (1 - share) * last.irradiance.sum(axis=0) + share * new.irradiance.sum(axis=0)
    np.testing.assert_allclose(irradiance.sum(axis=0) + left_over, expected, rtol=1e-12, atol=1e-15)
    assert len(new) == 0 or not left_over.any()


@settings(deadline=None, max_examples=50)
@given(seed=SEEDS, share=SHARES)
def test_what_stays_the_same_does_to_the_last_bit(seed, share):
    last, _ = two_sets(seed)
    (directions, irradiance, radius_rad, is_key), _ = mixed(last, last, share)
    assert directions.tobytes() == last.directions.tobytes()
    assert irradiance.tobytes() == last.irradiance.tobytes()
    assert radius_rad.tobytes() == last.angular_radius_rad.tobytes()
    assert is_key.tobytes() == last.is_key.tobytes()


@settings(deadline=None, max_examples=50)
@given(seed=SEEDS)
def test_a_share_of_one_is_the_new_lights(seed):
    last, new = two_sets(seed)
    assert_same_lights(mixed(last, new, 1.0)[0], (new.directions, new.irradiance))


@settings(deadline=None, max_examples=50)
@given(seed=SEEDS, share=SHARES)
def test_the_order_of_the_new_lights_does_not_matter(seed, share):
    last, new = two_sets(seed)
    order = np.random.default_rng(seed).permutation(len(new))
    other = LightSet(
        new.directions[order],
        new.irradiance[order],
        new.angular_radius_rad[order],
        is_key=new.is_key[order],
    )
    (one, _), (two, _) = mixed(last, new, share), mixed(last, other, share)
    assert_same_lights(one, two)


def test_a_match_takes_its_place_and_others_the_free_ones():
    last = LightSet(
        towards([0, 40, 80, 120]),
        [[1.0] * 3, [0.0] * 3, [1.0] * 3, [1.0] * 3],
        np.zeros(4),
    )
    new = LightSet(towards([200, 121, 240, 1]), np.ones((4, 3)), np.zeros(4))
    (directions, irradiance, _, _), _ = mixed(last, new, 0.5)
    # 1° is far for points: they turn to where the new ones stand.
    np.testing.assert_allclose(directions, towards([1, 200, 80, 121, 240]), atol=1e-12)
    np.testing.assert_allclose(irradiance[:, 0], [1, 0.5, 0.5, 1, 0.5])


def test_a_new_light_comes_with_its_extent_and_kind():
    last = LightSet(towards([0]), np.ones((1, 3)), [0.1])
    new = LightSet(towards([0, 90]), np.ones((2, 3)), [0.3, 0.2], is_key=np.array([False, True]))
    (_, _, radius_rad, is_key), _ = mixed(last, new, 0.25)
    np.testing.assert_allclose(radius_rad, [0.15, 0.2])
    np.testing.assert_array_equal(is_key, [False, True])


@pytest.mark.parametrize(
    ("turn_deg", "radius_deg", "part"),
    [(1, 10, 0.3), (4, 10, 0.4), (9, 5, 1.0), (0.1, 0, np.radians(0.1) / SUN_RADIUS_RAD)],
)
def test_a_light_turns_by_the_share_or_by_how_far_it_is_in_radii(turn_deg, radius_deg, part):
    radius = np.radians([radius_deg])
    last = LightSet(towards([0]), np.ones((1, 3)), radius)
    new = LightSet(towards([turn_deg]), np.ones((1, 3)), radius)
    direction = mixed(last, new, 0.3)[0][0][0]
    turned_deg = np.degrees(np.arctan2(direction[0], direction[1]))
    # A chord's parts are not an arc's: 4e-4 of 10°. A turn is measured by its chord, too.
    assert turned_deg == pytest.approx(part * turn_deg, rel=5e-3)


@pytest.mark.parametrize(("before_deg", "after_deg"), [(5, 10), (10, 5)])
def test_a_turn_is_measured_by_the_larger_radius_which_changes_as_much(before_deg, after_deg):
    last = LightSet(towards([0]), np.ones((1, 3)), np.radians([before_deg]))
    new = LightSet(towards([4]), np.ones((1, 3)), np.radians([after_deg]))
    (directions, _, radius_rad, _), _ = mixed(last, new, 0.3)
    assert np.degrees(np.arctan2(*directions[0, :2])) == pytest.approx(0.4 * 4, rel=5e-3)
    assert np.degrees(radius_rad[0]) == pytest.approx(0.6 * before_deg + 0.4 * after_deg, rel=1e-3)


def test_the_stronger_light_draws_the_direction():
    radius = np.radians([60.0])
    last = LightSet(towards([0]), np.full((1, 3), 3.0), radius)
    new = LightSet(towards([8]), np.ones((1, 3)), radius)
    direction = mixed(last, new, 0.5)[0][0][0]
    assert np.degrees(np.arctan2(direction[0], direction[1])) == pytest.approx(2.0, rel=5e-3)


def test_between_lights_further_than_ten_degrees_apart_there_is_nothing():
    last = LightSet(towards([0]), np.ones((1, 3)), np.radians([30.0]))
    new = LightSet(towards([10.1]), np.ones((1, 3)), np.radians([30.0]))
    (directions, irradiance, _, _), _ = mixed(last, new, 0.5)
    np.testing.assert_array_equal(directions, np.concatenate([last.directions, new.directions]))
    np.testing.assert_array_equal(irradiance, np.full((2, 3), 0.5))


def test_a_faint_light_leaves_its_light_to_the_nearest():
    last = LightSet(towards([0, 50, 100]), [[1.0] * 3, [0.11] * 3, [1.0] * 3], np.zeros(3))
    new = LightSet(towards([0, 100]), np.ones((2, 3)), np.zeros(2))
    (_, fading, _, _), _ = mixed(last, new, 0.05)  # 0.1045 is left, above a tenth of the mean
    np.testing.assert_allclose(fading[:, 0], [1, 0.1045, 1])
    (directions, irradiance, _, _), _ = mixed(last, new, 0.1)  # 0.099
    np.testing.assert_allclose(irradiance[:, 0], [1.099, 0, 1])
    np.testing.assert_array_equal(directions, last.directions)


def test_dark_lights_among_the_new_take_no_place_and_no_light():
    last = LightSet(towards([0, 40, 100]), [[1.0] * 3, [0.01] * 3, [1.0] * 3], np.zeros(3))
    power = np.array([1.0, 0.0, 1.0, 1.0])
    new = LightSet(towards([0, 40, 100, 240]), power[:, None] * np.ones(3), np.zeros(4))
    (directions, irradiance, _, _), _ = mixed(last, new, 0.1)
    np.testing.assert_allclose(irradiance[:, 0], [1.009, 0.1, 1])
    np.testing.assert_allclose(directions, towards([0, 240, 100]), atol=1e-12)


def test_no_more_lights_fade_than_stated_and_the_strongest_do():
    count = MOST_FADING + 20
    power = 1 + np.arange(count)[:, None] * np.ones(3) / count
    last = LightSet(towards(np.linspace(0, 90, count)), power, np.zeros(count))
    new = LightSet(towards([180, 200]), np.ones((2, 3)), np.zeros(2))
    (_, irradiance, _, _), _ = mixed(last, new, 0.1)
    np.testing.assert_allclose(irradiance[20:], 0.9 * power[20:])
    # Two places are taken by the new lights, which have what was left of twenty.
    assert np.count_nonzero(irradiance[:20].any(axis=1)) == 2
    np.testing.assert_allclose(irradiance.sum(), 0.9 * power.sum() + 0.1 * 6)


def test_without_new_light_all_go_out_and_their_light_is_left_over():
    last = random_set(np.random.default_rng(3), 5)
    dark = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    (directions, _, _, _), left_over = mixed(last, dark, 0.25)
    assert len(directions) == 0
    np.testing.assert_allclose(left_over, 0.75 * last.irradiance.sum(axis=0))


def test_a_key_light_does_not_become_a_part_of_the_sky():
    last = LightSet(towards([0]), np.ones((1, 3)), np.zeros(1), is_key=np.array([True]))
    new = LightSet(towards([0]), np.ones((1, 3)), np.zeros(1))
    (_, irradiance, _, is_key), _ = mixed(last, new, 0.5)
    np.testing.assert_array_equal(is_key, [True, False])
    assert luminance(irradiance) == pytest.approx([0.5, 0.5])
