"""The inverse-CDF method: values by hand, and a plain numpy version as the oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lighting.methods.inverse_cdf import inverse_cdf, sample_directions
from lighting.sampling.low_discrepancy import low_discrepancy_points
from lighting.sphere.latlong import direction_to_grid
from tests.environments import (
    constant,
    environment,
    one_hot,
    outdoors,
    sun_in_sky,
    two_cells,
)

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def numpy_inverse_cdf(radiance, count):
    """Return directions and irradiance, with full tables and a loop over the lights."""
    height, width, _ = radiance.shape
    radiance = radiance.astype(np.float64)
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    light = radiance * (np.pi / height * (edges[:-1] - edges[1:]))[:, None, None]
    luminous = light @ WEIGHTS
    rows = np.cumsum(luminous.sum(axis=1))
    directions, irradiance = [], []
    for u, v in low_discrepancy_points(count):
        target = v * rows[-1]
        r = np.searchsorted(rows, target, side="right")
        into_row = (target - np.append(0, rows)[r]) / luminous[r].sum()
        cells = np.cumsum(luminous[r])
        target = u * cells[-1]
        c = np.searchsorted(cells, target, side="right")
        into_cell = (target - np.append(0, cells)[c]) / luminous[r, c]
        cos_theta = edges[r] * (1 - into_row) + edges[r + 1] * into_row
        theta, phi = np.arccos(cos_theta), np.pi - 2 * np.pi * (c + into_cell) / width
        directions.append((np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)))
        irradiance.append(radiance[r, c] / (radiance[r, c] @ WEIGHTS) * luminous.sum() / count)
    irradiance = np.array(irradiance)
    return np.array(directions), irradiance * light.sum(axis=(0, 1)) / irradiance.sum(axis=0)


@pytest.mark.parametrize("count", [1, 7, 64, 1000])
@pytest.mark.parametrize(
    "environment_map", [constant(), sun_in_sky(), outdoors()], ids=["constant", "sun", "outdoors"]
)
def test_agrees_with_plain_numpy(environment_map, count):
    directions, irradiance, _ = inverse_cdf(environment_map, count)
    expected_directions, expected_irradiance = numpy_inverse_cdf(environment_map.radiance, count)
    np.testing.assert_allclose(directions, expected_directions, atol=1e-9)
    np.testing.assert_allclose(irradiance, expected_irradiance, rtol=1e-9)


@settings(deadline=None, max_examples=60)
@given(
    radiance=st.integers(2, 6).flatmap(
        lambda n: arrays(
            np.float32,
            (n, 2 * n, 3),
            elements=st.sampled_from([0.0, 1e-40, 1e-3, 1.0, 7.0, 1e6, 3e38]),
        )
    ),
    count=st.integers(1, 40),
)
def test_lights_lie_in_lit_cells_and_keep_the_energy(radiance, count):
    environment_map = environment(radiance)
    directions, irradiance, angular_radius_rad = inverse_cdf(environment_map, count)
    if not radiance.any():
        assert len(directions) == 0
        return
    assert len(directions) == count
    column, row = np.moveaxis(direction_to_grid(directions, environment_map.height), -1, 0)
    # A light on the border of its cell may round into the neighbour.
    near = [
        radiance[
            np.clip(np.round(row + dy).astype(int), 0, len(radiance) - 1),
            np.round(column + dx).astype(int) % radiance.shape[1],
        ].any(axis=-1)
        for dy in (-1e-6, 1e-6)
        for dx in (-1e-6, 1e-6)
    ]
    assert np.any(near, axis=0).all()
    assert np.isfinite(irradiance).all()
    assert np.isfinite(angular_radius_rad).all()
    light = radiance.astype(np.float64).sum(axis=1)
    edges = np.cos(np.linspace(0, np.pi, len(radiance) + 1))
    integral = np.pi / len(radiance) * (edges[:-1] - edges[1:]) @ light
    np.testing.assert_allclose(irradiance.sum(axis=0), integral, rtol=1e-9)


def test_lights_have_equal_luminous_power_on_a_grey_map():
    # On a grey map no colour correction is needed: every light has Φ/n in each channel, Φ = 4π.
    _, irradiance, _ = inverse_cdf(constant(), 50)
    np.testing.assert_allclose(irradiance, 4 * np.pi / 50, rtol=1e-6)


def test_two_cells_share_the_lights_by_luminous_power():
    # Row 4 of 16 spans cos 45° − cos 56.25°, row 11 the same below the horizon: equal solid angles,
    # so of 1000 lights the red cell takes 5·0.2126/(5·0.2126 + 2·0.0722) = 0.8804.
    directions, irradiance, _ = inverse_cdf(two_cells(), 1000)
    red = directions[:, 1] > 0
    assert abs(red.sum() - 880.4) <= 2
    assert not irradiance[red, 2].any()
    assert not irradiance[~red, 0].any()


def test_the_middle_of_a_cell_is_reached_by_half_its_share():
    # One lit cell: the point (½, ½) has half the cell's azimuth and half its solid angle beside it.
    height, row, column = 4, 1, 2
    directions, density = sample_directions(one_hot(height, (row, column)), np.array([[0.5, 0.5]]))
    y = (np.cos(np.pi * row / height) + np.cos(np.pi * (row + 1) / height)) / 2
    phi = np.pi - 2 * np.pi * (column + 0.5) / (2 * height)
    expected = [np.sqrt(1 - y * y) * np.sin(phi), y, np.sqrt(1 - y * y) * np.cos(phi)]
    np.testing.assert_allclose(directions[0], expected, atol=1e-12)
    solid_angle = np.pi / height * (np.cos(np.pi / 4) - np.cos(np.pi / 2))
    assert density[0] == pytest.approx(1 / solid_angle)


def test_angular_radius_is_that_of_the_cone_with_the_lights_share_of_the_sphere():
    # n lights on a constant map have 4π/n each, and 2π(1 − cos α) = 4π/n.
    count = 100
    _, _, angular_radius_rad = inverse_cdf(constant(), count)
    np.testing.assert_allclose(angular_radius_rad, np.arccos(1 - 2 / count), rtol=1e-6)


def test_angular_radius_of_lights_in_one_cell_fills_that_cell():
    _, _, angular_radius_rad = inverse_cdf(one_hot(16, (5, 7)), 10)
    cell = np.pi / 16 * (np.cos(5 * np.pi / 16) - np.cos(6 * np.pi / 16))
    np.testing.assert_allclose(2 * np.pi * (1 - np.cos(angular_radius_rad)), cell / 10, rtol=1e-6)


def test_angular_radius_stops_at_a_hemisphere():
    _, _, angular_radius_rad = inverse_cdf(constant(), 1)
    assert angular_radius_rad[0] == pytest.approx(np.pi / 2)


def test_a_channel_that_no_light_caught_is_spread_evenly():
    # A single light falls on the red cell, which has most of the power; blue is elsewhere.
    environment_map = two_cells()
    _, irradiance, _ = inverse_cdf(environment_map, 1)
    np.testing.assert_allclose(irradiance[0], environment_map.integral(), rtol=1e-6)
    _, irradiance, _ = inverse_cdf(environment_map, 3)
    np.testing.assert_allclose(irradiance[:, 2], environment_map.integral()[2] / 3, rtol=1e-6)


def lit_rows_between_dark():
    """Return a map of 4 rows with the cells 2 to 5 of the middle two rows lit."""
    radiance = np.zeros((4, 8))
    radiance[1:3, 2:6] = 0.7
    return environment(radiance)


def test_the_end_of_the_square_stays_in_the_last_lit_cell():
    last = np.nextafter(1.0, 0.0)
    directions, _ = sample_directions(lit_rows_between_dark(), np.array([[last, last]]))
    assert direction_to_grid(directions[0], 4) == pytest.approx([5.5, 2.5])


def test_the_origin_of_the_square_goes_to_the_first_lit_cell():
    directions, _ = sample_directions(lit_rows_between_dark(), np.zeros((1, 2)))
    assert direction_to_grid(directions[0], 4) == pytest.approx([1.5, 0.5])


def test_sampling_a_map_without_light_is_refused():
    with pytest.raises(ValueError, match="without light"):
        sample_directions(environment(np.zeros((4, 8))), np.array([[0.5, 0.5]]))
