"""The chart: there and back, equal areas, and its gores."""

import numpy as np
import pytest

from lighting.sphere.equal_area_chart import directions_of, on_chart, on_sphere
from lighting.sphere.latlong import direction_to_grid
from tests.environments import normals


def turns_and_heights(count):
    random = np.random.default_rng(0)
    return random.uniform(0, 4, count), random.uniform(-1, 1, count)


def test_there_and_back_again():
    turn, height = turns_and_heights(1000)
    turn_again, height_again, is_on_chart = on_sphere(*on_chart(turn, height))
    assert is_on_chart.all()
    np.testing.assert_allclose(turn_again, turn, atol=1e-9)
    np.testing.assert_allclose(height_again, height, atol=1e-12)


def test_the_right_edge_belongs_to_the_last_gore():
    t, _ = on_chart(np.array([4.0, 4.0]), np.array([0.9, -0.9]))
    assert (t < 3.9).all()


def test_areas_are_equal():
    # The Jacobian of (turn, height) → (t, u) is the ratio of areas: 6 on the chart for 4 × 2.
    turn, height = turns_and_heights(1000)
    step = 1e-6
    inside = (np.abs(turn - np.round(turn)) > 1e-3) & (np.abs(np.abs(height) - 2 / 3) > 1e-3)
    turn, height = turn[inside], height[inside] * 0.999
    along = np.subtract(on_chart(turn + step, height), on_chart(turn - step, height))
    up = np.subtract(on_chart(turn, height + step), on_chart(turn, height - step))
    area = (along[0] * up[1] - along[1] * up[0]) / (2 * step) ** 2
    np.testing.assert_allclose(area, 6 / 8, rtol=1e-4)


def test_between_gores_is_off_the_chart():
    t = np.array([1.0, 1.4, 1.5, -0.1, 4.0, 1.5])
    u = np.array([0.75, 0.95, 0.95, 0.0, 0.0, 1.0])
    _, _, is_on_chart = on_sphere(t, u)
    np.testing.assert_array_equal(is_on_chart, [False, False, True, False, False, False])


@pytest.mark.parametrize("column", [0.0, 3.25, 15.0])
def test_turns_go_with_the_columns(column):
    direction = directions_of(np.array([(column + 0.5) / 4]), np.array([0.3]))
    assert direction_to_grid(direction, 8)[0, 0] == pytest.approx(column)


def test_a_direction_is_where_its_turn_and_height_say():
    towards = normals()
    turn = 2 * (1 - np.arctan2(towards[:, 0], towards[:, 2]) / np.pi)
    np.testing.assert_allclose(directions_of(turn, towards[:, 1]), towards, atol=1e-12)
