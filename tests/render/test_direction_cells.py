"""Cells of equal solid angle, and lights spread over them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.sphere.latlong import solid_angles
from render.baked.direction_cells import (
    cell_of,
    direction_cells,
    disc_points,
    map_over_cells,
    spread_over_cells,
)

UPPER = direction_cells(upper_only=True)
SPHERE = direction_cells(upper_only=False)


def test_points_are_unit_vectors_in_cells_that_fill_the_hemisphere():
    np.testing.assert_allclose(np.linalg.norm(UPPER.points, axis=-1), 1, atol=1e-12)
    assert UPPER.points[..., 1].min() > 0
    assert UPPER.count * UPPER.solid_angle_sr == pytest.approx(2 * math.pi)
    assert SPHERE.count == 2 * UPPER.count


@pytest.mark.parametrize("cells", [UPPER, SPHERE])
def test_points_are_spread_evenly(cells):
    """∫ y² over a hemisphere is 2π/3, and ∫ x² as much; ∫ |y| is π."""
    weight = cells.solid_angle_sr / cells.points.shape[1]
    hemispheres = cells.count / UPPER.count
    x, y, z = np.moveaxis(cells.points, -1, 0)
    for mean, expected in ((x * x, 2 / 3), (y * y, 2 / 3), (z * z, 2 / 3), (np.abs(y), 1.0)):
        assert mean.sum() * weight == pytest.approx(hemispheres * math.pi * expected, rel=2e-4)


def test_the_points_of_a_cell_lie_together():
    """A square of 7° bent to at most twice its width: no point farther than 9° from its mean."""
    mean = UPPER.points.mean(axis=1)
    cosine = (UPPER.points * (mean / np.linalg.norm(mean, axis=1)[:, None])[:, None]).sum(axis=-1)
    assert math.degrees(math.acos(cosine.min())) < 9


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.0, 0.9), st.floats(-3.1, 3.1), st.floats(0.0, 0.6), st.sampled_from([UPPER, SPHERE])
)
def test_a_surface_that_faces_a_light_receives_as_much_from_its_cells(y, phi, radius, cells):
    level = math.sqrt(1 - y * y)
    direction = np.array([level * math.sin(phi), y, level * math.cos(phi)])
    light = spread_over_cells(
        cells, direction[None], np.array([[1.0, 2.0, 0.0]]), np.array([radius])
    )
    facing = (cells.points @ direction).mean(axis=1) @ light
    np.testing.assert_allclose(facing, (1 + math.cos(radius)) / 2 * np.array([1, 2, 0]), atol=1e-9)


def test_a_light_is_where_it_was():
    direction = np.array([0.48, 0.64, 0.6])
    light = spread_over_cells(UPPER, direction[None], np.ones((1, 3)), np.array([0.1]))
    mean = light[:, 0] @ UPPER.points.mean(axis=1)
    assert math.degrees(math.acos(mean @ direction / np.linalg.norm(mean))) < 1


@pytest.mark.parametrize("radius_deg", [8, 10, 15])
def test_a_disc_spreads_no_wider_than_it_is(radius_deg):
    """Else its cells would need more power for a surface that faces it to receive as much."""
    direction = np.array([0.1, 0.9, 0.0]) / math.hypot(0.1, 0.9)
    light = spread_over_cells(
        UPPER, direction[None], np.ones((1, 3)), np.array([math.radians(radius_deg)])
    )
    np.testing.assert_allclose(light.sum(axis=0), 1, atol=0.0035)


def test_a_narrow_light_moves_without_steps():
    """A hundredth of a cell's width on, no more than a twentieth of the light is elsewhere."""
    angle = np.linspace(0.2, 0.6, 1 + int(0.4 / (0.01 * UPPER.width_rad)))
    directions = np.stack([np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=-1)
    light = np.stack(
        [
            spread_over_cells(UPPER, each[None], np.ones((1, 3)), np.zeros(1))[:, 0]
            for each in directions
        ]
    )
    assert 0.5 * np.abs(np.diff(light, axis=0)).sum(axis=1).max() < 0.05


def test_no_lights_are_no_light():
    none = spread_over_cells(UPPER, np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    np.testing.assert_array_equal(none, np.zeros((UPPER.count, 3)))


@pytest.mark.parametrize("radius", [0.0, 0.005, 0.3])
def test_points_of_a_disc_are_spread_evenly_over_it(radius):
    direction = np.array([0.6, 0.0, -0.8])
    points = disc_points(direction, radius, 16)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-12)
    assert (points @ direction).min() > math.cos(radius) - 1e-12
    facing = (1 + math.cos(radius)) / 2
    assert points.mean(axis=0) @ direction == pytest.approx(facing, abs=1e-9)
    across = points.mean(axis=0) - facing * direction
    assert np.linalg.norm(across) <= 0.05 * radius + 1e-12


@pytest.mark.parametrize("upper_only", [True, False])
def test_a_direction_lies_in_the_cell_whose_points_are_about_it(upper_only):
    cells = direction_cells(upper_only=upper_only)
    found = cell_of(cells.points, upper_only=upper_only)
    np.testing.assert_array_equal(found, np.repeat(np.arange(cells.count)[:, None], 64, axis=1))


def test_a_map_over_cells_keeps_its_light():
    radiance = np.random.default_rng(0).random((32, 64, 3))
    weights = solid_angles(32)[:, None, None]
    every = map_over_cells(radiance, upper_only=False)
    upper = map_over_cells(radiance, upper_only=True)
    np.testing.assert_allclose(every.sum(axis=0), (radiance * weights).sum(axis=(0, 1)))
    np.testing.assert_allclose(upper.sum(axis=0), (radiance * weights)[:16].sum(axis=(0, 1)))
