"""The display transform."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from capture.sensor import srgb_encode
from render.output.view import SHOULDER, _code, _code_tables, auto_exposure_ev, roll_off, to_display


def test_the_curve_is_that_of_colour_science():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that scipy is absent
        colour = pytest.importorskip("colour")
    linear = np.linspace(0, 1, 4097)
    expected = colour.cctf_encoding(linear, function="sRGB")
    assert_allclose(srgb_encode(linear), expected, atol=1e-12)


def test_below_the_shoulder_only_exposure_and_curve_act():
    linear = np.linspace(0, SHOULDER / 2, 333).reshape(1, 111, 3)
    assert_array_equal(to_display(linear, 1.0), np.rint(255 * srgb_encode(2 * linear)))


def test_every_code_begins_where_the_formula_says():
    _, begins = _code_tables()
    for toward, expected in ((begins[1:-1], np.arange(1, 256)), (0, np.arange(255))):
        beside = np.nextafter(begins[1:-1], np.float32(toward))
        assert_array_equal(_code(beside.astype(np.float64)), expected)
        assert_array_equal(
            to_display(np.repeat(beside[None, :, None], 3, 2), 0.0)[0, :, 0], expected
        )
    spread = np.float32(10.0) ** np.linspace(-9, 9, 99_999, dtype=np.float32)
    shown = to_display(np.repeat(spread[None, :, None], 4, 2), 0.0)
    assert_array_equal(shown[0, :, 2], _code(spread.astype(np.float64)))


def test_between_neighbours_of_the_table_one_code_begins_at_most():
    codes, _ = _code_tables()
    assert np.diff(codes.astype(int)).max() == 1


def test_what_is_no_light_is_black():
    picture = np.array([[[-1.0, -0.0, np.nan]]], np.float32)
    assert_array_equal(to_display(picture, 3.0), np.zeros((1, 1, 3)))


def test_known_values():
    # Middle grey 0.18 → 0.4614; linear 0 and ∞.
    picture = np.array([[[0.18, 0.0, np.inf]]], np.float32)
    assert_array_equal(to_display(picture, 0.0), [[[118, 0, 255]]])


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(0, 1e6, width=32), min_size=2, max_size=50), st.floats(-10, 10))
def test_brighter_is_never_darker(values, exposure_ev):
    ramp = np.repeat(np.sort(np.float32(values))[None, :, None], 3, axis=2)
    assert np.all(np.diff(to_display(ramp, exposure_ev).astype(int), axis=1) >= 0)


def test_the_shoulder_starts_smoothly_and_ends_at_white():
    step = 1e-4
    levels = SHOULDER + step * np.arange(-3, 4)
    assert_allclose(np.diff(roll_off(levels)), step, rtol=5e-3)
    assert_array_equal(roll_off(levels[:3]), levels[:3])
    # One shoulder's width above it, half of the way to white is done.
    assert_allclose(roll_off(np.array([1.0])), (SHOULDER + 1) / 2)
    assert_array_equal(roll_off(np.array([np.inf])), 1)


@pytest.mark.parametrize("level", [1e-4, 0.18, 3e5])
def test_auto_exposure_brings_an_even_picture_to_middle_grey(level):
    picture = np.full((4, 5, 4), level)
    picture[..., 3] = 1
    assert_allclose(level * 2 ** auto_exposure_ev(picture), 0.18)


def test_auto_exposure_looks_at_the_scene_not_at_the_background():
    picture = np.full((4, 5, 4), 0.18)
    picture[..., 3] = 1
    picture[:2] = [1e5, 1e5, 1e5, 0]
    picture[2, 0] = [0, 0, 0, 1]
    assert abs(auto_exposure_ev(picture)) < 1e-6


def test_a_black_picture_is_left_alone():
    assert auto_exposure_ev(np.zeros((3, 3, 4))) == 0
