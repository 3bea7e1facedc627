"""Harmonics of order 2: an orthonormal basis, its irradiance, and the window that keeps it lit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import irradiance, normals

HEIGHT = 64
DIRECTIONS = cell_directions(HEIGHT).reshape(-1, 3)
SOLID_ANGLE = np.repeat(solid_angles(HEIGHT), 2 * HEIGHT)
numbers = st.floats(-1, 1, allow_subnormal=False)
functions = st.lists(numbers, min_size=27, max_size=27).map(lambda n: np.reshape(n, (9, 3)))


def test_the_basis_is_orthonormal():
    values = harmonics.basis(DIRECTIONS)
    np.testing.assert_allclose(values.T * SOLID_ANGLE @ values, np.eye(9), atol=2e-3)


def test_each_function_is_the_one_of_its_place():
    # y, z and x alone make degree 1; the poles of +Z, not of +Y, make the middle of degree 2.
    x, y, z = harmonics.basis(np.eye(3))
    np.testing.assert_allclose([y[1], z[2], x[3]], np.sqrt(3 / (4 * np.pi)))
    np.testing.assert_allclose(
        [z[6], x[6], y[6]], np.sqrt(5 / (16 * np.pi)) * np.array([2, -1, -1])
    )
    np.testing.assert_allclose(
        [x[8], y[8], z[8]], np.sqrt(15 / (16 * np.pi)) * np.array([1, -1, 0])
    )


def test_integral_and_irradiance_are_those_of_the_sum_over_directions():
    fill = np.random.default_rng(0).uniform(-1, 1, (9, 3))
    light = harmonics.evaluate(fill, DIRECTIONS) * SOLID_ANGLE[:, None]
    np.testing.assert_allclose(harmonics.integral(fill), light.sum(axis=0), atol=1e-2)
    np.testing.assert_allclose(
        harmonics.irradiance(fill, normals()), irradiance(normals(), DIRECTIONS, light), atol=1e-2
    )


@settings(max_examples=60, deadline=None)
@given(functions)
def test_the_lowest_value_is_met_and_never_passed(fill):
    values = harmonics.evaluate(fill, DIRECTIONS).min(axis=0)
    lowest = harmonics.lowest(fill)
    assert (lowest <= values + 1e-9).all()
    np.testing.assert_allclose(lowest, values, atol=0.01)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_the_lowest_value_of_one_degree_alone(degree):
    # No linear part, or no quadratic one: where the equation for the least value degenerates.
    fill = np.zeros((9, 3))
    fill[degree * degree : (degree + 1) ** 2] = np.random.default_rng(1).uniform(
        -1, 1, (2 * degree + 1, 3)
    )
    values = harmonics.evaluate(fill, DIRECTIONS).min(axis=0)
    np.testing.assert_allclose(harmonics.lowest(fill), values, atol=0.01)


@settings(max_examples=60, deadline=None)
@given(functions)
def test_the_window_leaves_nothing_negative_and_smooths_no_more_than_needed(fill):
    fill = np.concatenate([np.abs(fill[:1]) + 0.01, fill[1:]])
    smooth = harmonics.windowed(fill)
    assert (harmonics.lowest(smooth) >= -1e-9).all()
    np.testing.assert_array_equal(smooth[0], fill[0])
    if (harmonics.lowest(fill) >= 0).all():
        np.testing.assert_array_equal(smooth, fill)
    elif np.abs(smooth[1:]).max() > 1e-6:
        assert harmonics.lowest(smooth).min() == pytest.approx(0, abs=1e-6)


def test_a_negative_integral_cannot_be_windowed():
    with pytest.raises(ValueError, match="negative integral"):
        harmonics.windowed(-np.eye(9)[:, :3])
