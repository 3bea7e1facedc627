"""The lat-long grid: exact solid angles, and coordinates there and back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.sphere.latlong import (
    cell_directions,
    direction_to_grid,
    grid_to_direction,
    solid_angles,
)


@given(height=st.integers(1, 300))
@settings(max_examples=20, deadline=None)
def test_solid_angles_sum_to_the_sphere(height: int) -> None:
    assert 2 * height * solid_angles(height).sum() == pytest.approx(4 * np.pi, rel=1e-13)


def test_a_cell_next_to_the_pole_has_the_area_of_its_slice_of_a_cap() -> None:
    # The cap of half-angle α has 2π (1 − cos α); row 0 of N = 4 is its eighth part, α = 45°.
    assert solid_angles(4)[0] == pytest.approx(2 * np.pi * (1 - np.sqrt(0.5)) / 8, rel=1e-14)


def test_the_mean_of_directions_is_zero_and_of_their_squares_a_third() -> None:
    directions = cell_directions(256)
    weights = np.repeat(solid_angles(256)[:, None], 512, axis=1) / (4 * np.pi)
    np.testing.assert_allclose(np.einsum("rc,rck->k", weights, directions), 0, atol=1e-12)
    # The midpoint rule errs by h² / 12 and the like, h = π/256.
    np.testing.assert_allclose(np.einsum("rc,rck->k", weights, directions**2), 1 / 3, atol=1e-4)


@given(column=st.floats(-0.5, 63.499), row=st.floats(-0.499, 31.499))
@settings(max_examples=100, deadline=None)
def test_coordinates_come_back(column: float, row: float) -> None:
    direction = grid_to_direction(np.array([column, row]), 32)
    assert np.linalg.norm(direction) == pytest.approx(1, abs=1e-14)
    there = direction_to_grid(3.0 * direction, 32)
    assert -0.5 <= there[0] < 63.5
    # Near a pole a step of a column is no distance: compare on the sphere, and off it in cells.
    np.testing.assert_allclose(grid_to_direction(there, 32), direction, atol=1e-12)
    assert there[1] == pytest.approx(row, abs=1e-9)


def test_a_pole_is_the_middle_of_the_edge_row() -> None:
    grid = direction_to_grid(np.array([[0.0, 1, 0], [0, -1, 0]]), 32)
    np.testing.assert_allclose(grid, [[31.5, -0.5], [31.5, 31.5]], atol=1e-12)


def test_both_sides_of_the_seam_lie_within_the_grid() -> None:
    grid = direction_to_grid(np.array([[1e-9, 0, -1.0], [-1e-9, 0, -1.0], [-0.0, 0, -1.0]]), 32)
    assert ((grid[:, 0] >= -0.5) & (grid[:, 0] < 63.5)).all()
    assert grid[0, 0] == pytest.approx(-0.5, abs=1e-6)
    assert grid[1, 0] == pytest.approx(63.5, abs=1e-6)
