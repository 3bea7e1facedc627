"""The hierarchical warp: values by hand, and a plain recursive version as the oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lighting.methods.hierarchical import hierarchical, sample_directions
from lighting.sampling.low_discrepancy import low_discrepancy_points
from lighting.sphere.latlong import direction_to_grid, solid_angles
from tests.environments import constant, environment, one_hot, outdoors, sun_in_sky, two_cells

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def plain_warp(light, x, y):
    """Return column and row of a point, from sums over whole blocks of cells (side, side)."""
    side = len(light)
    if side == 1:
        return x, y
    half = side // 2
    rows, columns = slice(0, half), slice(0, half)
    share = light[:half].sum() / light.sum()
    if y < share:
        y = y / share
    else:
        rows, y = slice(half, side), (y - share) / (1 - share)
    share = light[rows, :half].sum() / light[rows].sum()
    if x < share:
        x = x / share
    else:
        columns, x = slice(half, side), (x - share) / (1 - share)
    x, y = plain_warp(light[rows, columns], x, y)
    return x + columns.start, y + rows.start


@pytest.mark.parametrize(
    "environment_map",
    [constant(), sun_in_sky(), outdoors(), outdoors(11), outdoors(24)],
    ids=["constant", "sun", "outdoors", "11 rows", "24 rows"],
)
def test_agrees_with_plain_recursion(environment_map):
    height = environment_map.height
    light = environment_map.radiance.astype(np.float64) @ WEIGHTS * solid_angles(height)[:, None]
    side = 1 << (2 * height - 1).bit_length()
    square = np.pad(light, ((0, side - height), (0, side - 2 * height)))
    points = low_discrepancy_points(300)
    expected = np.array([plain_warp(square, x, y) for x, y in points])
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    row = expected[:, 1].astype(int)
    y = edges[row] + (expected[:, 1] - row) * (edges[row + 1] - edges[row])
    directions, _, _ = hierarchical(environment_map, 300)
    np.testing.assert_allclose(directions[:, 1], y, atol=1e-9)
    column, _ = np.moveaxis(direction_to_grid(directions, height) + 0.5, -1, 0)
    np.testing.assert_allclose(column, expected[:, 0], atol=1e-6)


@settings(deadline=None, max_examples=60)
@given(
    radiance=st.integers(2, 6).flatmap(
        lambda n: arrays(
            np.float32,
            (n, 2 * n, 3),
            elements=st.sampled_from([0.0, 1e-40, 1e-3, 1.0, 7.0, 1e6, 3e38]),
        )
    ),
    points=arrays(
        np.float64,
        (12, 2),
        elements=st.floats(0, 1, exclude_max=True) | st.just(np.nextafter(1.0, 0.0)),
    ),
)
def test_points_go_to_lit_cells(radiance, points):
    environment_map = environment(radiance)
    if not radiance.any():
        with pytest.raises(ValueError, match="without light"):
            sample_directions(environment_map, points)
        return
    directions, density = sample_directions(environment_map, points)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-12)
    # A point in a dark cell would have the density 0.
    assert (density > 0).all()
    assert np.isfinite(density).all()


def test_the_middle_of_a_cell_is_reached_by_half_its_share():
    # One lit cell: the point (½, ½) has half the cell's azimuth and half its solid angle beside it.
    height, row, column = 5, 3, 2
    directions, density = sample_directions(one_hot(height, (row, column)), np.array([[0.5, 0.5]]))
    y = (np.cos(np.pi * row / height) + np.cos(np.pi * (row + 1) / height)) / 2
    phi = np.pi - 2 * np.pi * (column + 0.5) / (2 * height)
    expected = [np.sqrt(1 - y * y) * np.sin(phi), y, np.sqrt(1 - y * y) * np.cos(phi)]
    np.testing.assert_allclose(directions[0], expected, atol=1e-12)
    assert density[0] == pytest.approx(1 / solid_angles(height)[row])


def test_two_cells_share_the_lights_by_luminous_power():
    # As for the inverse CDF: the red cell takes 0.8804 of the lights.
    directions, _, _ = hierarchical(two_cells(), 1000)
    assert abs((directions[:, 1] > 0).sum() - 880.4) <= 2
