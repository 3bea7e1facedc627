"""The figures of a sequence, from cases whose figures are known."""

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.measures.steadiness import direction_motion, error_change, excess_change, lag_of_step
from tests.lighting_sets import towards

SURFACES = 5


def even(values):
    """Return the irradiance (T, 5, 3) of surfaces that are all as bright in each frame."""
    return np.ones((1, SURFACES, 3)) * np.asarray(values, float)[:, None, None]


def lights(angles_deg, powers):
    powers = np.asarray(powers, float)[:, None] * np.ones(3)
    return LightSet(towards(angles_deg), powers, np.zeros(len(powers)))


def test_a_change_that_is_true_is_neither_excess_nor_error():
    true = even([1, 2, 3])
    np.testing.assert_array_equal(excess_change(true, true), [0, 0])
    np.testing.assert_array_equal(error_change(true, true), [0, 0])


def test_an_error_that_stays_is_no_change():
    true = even([1, 1, 1])
    np.testing.assert_array_equal(excess_change(true + 0.5, true), [0, 0])
    np.testing.assert_array_equal(error_change(true + 0.5, true), [0, 0])


def test_flicker_on_a_still_scene_is_both():
    true, measured = even([2, 2, 2]), even([2, 2.2, 2])
    np.testing.assert_allclose(excess_change(measured, true), [0.1, 0.1])
    np.testing.assert_allclose(error_change(measured, true), [0.1, 0.1])


def test_too_little_change_is_an_error_but_no_excess():
    true, measured = even([1.0, 1.4]), even([1.0, 1.1])
    size = np.sqrt((1 + 1.4**2) / 2)
    np.testing.assert_array_equal(excess_change(measured, true), [0])
    np.testing.assert_allclose(error_change(measured, true), [0.3 / size])


def test_a_change_elsewhere_than_it_should_be_is_an_error_only():
    true, measured = even([1.0, 1.0]), even([1.0, 1.0])
    true[1, 0], measured[1, 1] = 2.0, 2.0
    assert excess_change(measured, true)[0] == pytest.approx(0)
    assert error_change(measured, true)[0] > 0.5


def test_in_the_dark_nothing_changes():
    assert excess_change(even([0, 1]), even([0, 0])) == 0
    assert error_change(even([0, 1]), even([0, 0])) == 0


def test_motion_is_the_mean_turn_by_power_and_the_largest():
    mean_rad, largest_rad = direction_motion(lights([0, 90], [3, 1]), lights([1, 95], [3, 1]))
    assert np.degrees(mean_rad) == pytest.approx((3 * 1 + 1 * 5) / 4)
    assert np.degrees(largest_rad) == pytest.approx(5)


def test_motion_does_not_depend_on_the_order():
    mean_rad, largest_rad = direction_motion(lights([0, 90], [3, 1]), lights([90, 0], [1, 3]))
    assert mean_rad == largest_rad == 0


def test_what_no_light_has_in_both_frames_does_not_move():
    # One light of three goes out; one fades in elsewhere from nothing.
    before, after = lights([0, 90, 45], [1, 1, 1]), lights([0, 90, 170], [1, 1, 0])
    assert direction_motion(before, lights([0, 90], [1, 1])) == (0, 0)
    assert direction_motion(before, after) == (0, 0)


def test_the_motion_of_a_light_that_does_not_matter_is_not_the_largest():
    before, after = lights([0, 90], [1, 0.009]), lights([0, 120], [1, 0.009])
    mean_rad, largest_rad = direction_motion(before, after)
    assert largest_rad == 0
    assert np.degrees(mean_rad) == pytest.approx(30 * 0.009 / 1.009)


def test_a_light_matters_by_its_share_of_all_light_not_of_the_brightest():
    # The last has 0.012 of the brightest, but 0.4 % of all.
    before, after = (
        lights([0, 90, 180, 45], [1, 1, 1, 0.012]),
        lights([0, 90, 180, 55], [1, 1, 1, 0.012]),
    )
    assert direction_motion(before, after)[1] == 0


def test_without_lights_nothing_moves():
    none = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    assert direction_motion(none, lights([0], [1])) == (0, 0)
    assert direction_motion(lights([0], [1]), none) == (0, 0)
    assert direction_motion(lights([0], [0]), lights([9], [0])) == (0, 0)


@pytest.mark.parametrize(
    ("light", "lag_s"),
    [
        ([1, 1, 2, 2, 2, 2], 0.0),
        ([1, 1, 1, 2, 2, 2], 0.1),
        ([1, 1, 1.5, 1.89, 1.91, 2], 0.2),
        ([1, 1, 2.5, 1.5, 2, 2], 0.2),  # overshoot counts until it is over
        ([2, 2, 1, 1, 1, 1], 0.0),
        ([1, 1, 1, 1, 1, 1], np.inf),
    ],
    ids=str,
)
def test_a_step_lags_until_it_stays_within_a_tenth(light, lag_s):
    assert lag_of_step(0.1 * np.arange(6), light, 2) == pytest.approx(lag_s)
