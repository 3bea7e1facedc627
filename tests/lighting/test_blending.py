"""Blends of lights: weights are shares, light is kept, and one light seen twice is one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from lighting.stream.blending import (
    FADE_S,
    blend_lights,
    blend_maps,
    followed_weights,
    place_weights,
)
from tests.lighting_sets import assert_same_lights, random_set, towards

SEEDS = st.integers(0, 2**32 - 1)


def blended(sets, weights):
    return blend_lights(sets, weights, timestamp_s=3.0, source="several")


def random_weights(random, count):
    weights = random.random(count) * (random.random(count) < 0.8)
    weights[random.integers(count)] += 0.1
    return weights / weights.sum()


def filled_set(random, count):
    coefficients = np.zeros((harmonics.COUNT, 3))
    coefficients[0] = random.random(3)
    return replace(random_set(random, count), fill=coefficients)


@settings(deadline=None, max_examples=25)
@given(seed=SEEDS)
def test_weights_of_places_are_shares_and_the_nearest_has_the_largest(seed):
    random = np.random.default_rng(seed)
    places = random.standard_normal((random.integers(1, 6), 3))
    at = random.standard_normal(3)
    weights = place_weights(places, at)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert weights.argmax() == np.linalg.norm(places - at, axis=1).argmin()
    np.testing.assert_allclose(place_weights(100 * places, 100 * at), weights, rtol=1e-9)


def test_weights_fall_with_the_square_of_the_distance_and_at_a_place_it_alone_counts():
    places = [(1.0, 0.0, 0.0), (-2.0, 0.0, 0.0)]
    np.testing.assert_allclose(place_weights(places, (0.0, 0.0, 0.0)), [0.8, 0.2])
    np.testing.assert_array_equal(place_weights(places, (1.0, 0.0, 0.0)), [1.0, 0.0])
    np.testing.assert_array_equal(place_weights([(1, 1, 1)] * 2, (1, 1, 1)), [0.5, 0.5])


@settings(deadline=None, max_examples=25)
@given(seed=SEEDS, elapsed_s=st.floats(0.0, 2.0))
def test_shown_weights_stay_shares_change_at_most_so_fast_and_arrive(seed, elapsed_s):
    random = np.random.default_rng(seed)
    shown, wanted = random_weights(random, 4), random_weights(random, 4)
    after = followed_weights(shown, wanted, elapsed_s)
    assert after.min() >= 0
    assert after.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(after - shown).max() <= elapsed_s / FADE_S + 1e-12
    np.testing.assert_array_equal(followed_weights(shown, wanted, FADE_S), wanted)


@settings(deadline=None, max_examples=25)
@given(seed=SEEDS)
def test_a_blend_has_the_weighted_light_of_its_parts(seed):
    random = np.random.default_rng(seed)
    sets = [filled_set(random, random.integers(0, 12)) for _ in range(3)]
    weights = random_weights(random, 3)
    total = sum(weight * each.integral() for weight, each in zip(weights, sets, strict=True))
    np.testing.assert_allclose(blended(sets, weights).integral(), total, rtol=1e-9)


@settings(deadline=None, max_examples=25)
@given(seed=SEEDS, share=st.sampled_from([0.01, 0.4, 0.9]))
def test_two_cameras_that_see_the_same_light_give_that_light(seed, share):
    # Lights that are crowded may find another partner, but no two have the same place.
    one = random_set(np.random.default_rng(seed), 7)
    both = blended([one, one], [share, 1 - share])
    assert_same_lights(
        (both.directions, both.irradiance, both.angular_radius_rad),
        (one.directions, one.irradiance, one.angular_radius_rad),
    )
    assert both.is_key.sum() == one.is_key.sum()


def lamp(angle_deg, irradiance, **rest):
    return LightSet(
        towards([angle_deg]), np.full((1, 3), irradiance), np.full(1, 0.1 * irradiance), **rest
    )


def test_a_lamp_seen_in_two_directions_is_one_light_if_they_are_near_and_two_if_not():
    near = blended([lamp(0, 1.0), lamp(8, 2.0)], [0.5, 0.5])
    assert len(near) == 1
    between = towards([0])[0] + 2 * towards([8])[0]
    np.testing.assert_allclose(near.directions[0], between / np.linalg.norm(between))
    np.testing.assert_allclose(near.irradiance[0], 1.5)
    np.testing.assert_allclose(near.angular_radius_rad, (0.1 + 2 * 0.2) / 3)
    assert len(blended([lamp(0, 1.0), lamp(12, 2.0)], [0.5, 0.5])) == 2


@pytest.mark.parametrize("share", [0.001, 0.3, 0.999])
def test_which_lights_are_one_does_not_depend_on_the_weights(share):
    random = np.random.default_rng(7)
    sets = [random_set(random, 30), random_set(random, 40)]
    merged = blended(sets, [0.5, 0.5])
    assert 40 < len(merged) < 70, "some are one and some are not"
    assert len(blended(sets, [share, 1 - share])) == len(merged)


def test_lights_without_power_and_sets_without_weight_leave_nothing():
    dark = lamp(0, 0.0)
    assert len(blended([dark, lamp(3, 1.0)], [0.5, 0.5])) == 1
    assert len(blended([dark, dark], [0.5, 0.5])) == 0
    alone = blended([lamp(0, 1.0), lamp(50, 5.0, scale="cd/m2")], [1.0, 0.0])
    np.testing.assert_array_equal(alone.irradiance, [[1.0] * 3])


def test_marks_travel_and_scales_must_agree():
    one = lamp(0, 1.0, clipped_fraction=0.5, predicted_error=0.02)
    other = lamp(90, 3.0, clipped_fraction=0.1, predicted_error=0.01)
    both = blended([one, other], [0.5, 0.5])
    assert both.clipped_fraction == pytest.approx((0.5 * 1 + 0.1 * 3) / 4)
    assert (both.predicted_error, both.timestamp_s, both.source) == (0.02, 3.0, "several")
    assert blended([one, lamp(90, 1.0)], [0.5, 0.5]).predicted_error is None
    with pytest.raises(InputError, match=r"lights in relative .* in cd/m2"):
        blended([one, lamp(0, 1.0, scale="cd/m2")], [0.5, 0.5])


def test_a_blended_map_is_the_weighted_sum_of_what_was_seen():
    def grey(level, seen_rows, clipped_rows):
        marks = np.zeros((2, 4, 8), np.bool_)
        marks[0, :seen_rows] = marks[1, :clipped_rows] = True
        return EnvironmentMap(np.full((4, 8, 3), level, np.float32), *marks)

    both = blend_maps([grey(1, 3, 0), grey(2, 2, 1), grey(9, 4, 4)], [0.25, 0.75, 0.0])
    np.testing.assert_allclose(both.radiance[:, 0, 0], [1.75, 1.75, 0.25, 0])
    assert both.valid[:, 0].tolist() == [True, True, True, False]
    assert both.clipped[:, 0].tolist() == [True, False, False, False]
