"""The tiling's numbers, each once; its points, nested and evenly spread; and the chart."""

import cmath

import numpy as np
import pytest
from scipy.spatial import cKDTree

from lighting.measures.error_measures import spread_directions
from lighting.methods.penrose import penrose
from lighting.sampling.penrose_tiling import points_below, points_in_rectangles
from lighting.sphere.latlong import direction_to_grid, solid_angles
from tests.environments import constant, sun_in_sky

ROOT = np.array([0, cmath.rect(1, 0.3 * np.pi), cmath.rect(1, -0.3 * np.pi)])
AREA = np.sin(0.6 * np.pi) / 2
ALL = (-9.0, 9.0, -9.0, 9.0)


def sequence(limit):
    numbers, points = points_below(ROOT, limit, *ALL)
    order = np.argsort(numbers)
    return numbers[order], points[order]


@pytest.mark.parametrize("limit", [1, 2, 3, 21, 100, 2584])
def test_each_number_is_there_once_and_keeps_its_point(limit):
    numbers, points = sequence(limit)
    np.testing.assert_array_equal(numbers, np.arange(limit))
    np.testing.assert_allclose(points, sequence(3000)[1][:limit], atol=1e-12)


@pytest.mark.parametrize("limit", [377, 500, 800, 987, 1300, 2000])
def test_points_keep_their_distance(limit):
    _, points = sequence(limit)
    tree = cKDTree(np.stack([points.real, points.imag], axis=1))
    distance = tree.query(tree.data, 2)[0][:, 1] / np.sqrt(AREA / limit)
    assert distance.min() > 0.52  # of random points 0.02
    assert distance.mean() > 0.67  # of random points 0.5


def test_a_rectangle_holds_the_points_that_are_in_it():
    numbers, points = sequence(2000)
    left, right, bottom, top = 0.2, 0.5, -0.3, 0.1
    inside = (points.real >= left) & (points.real <= right)
    inside &= (points.imag >= bottom) & (points.imag <= top)
    rectangles = np.array([[9.0, 9.1, 0.0, 1.0], [left, right, bottom, top]])
    found, _, owners = points_in_rectangles(ROOT, np.array([2000.0, 2000.0]), rectangles)
    np.testing.assert_array_equal(np.sort(found), numbers[inside])
    np.testing.assert_array_equal(owners, 1)


def test_lights_of_an_even_sky_are_everywhere_alike():
    # Nearest of 48 directions: each has 3000/48 = 62.5 ± √62.5 of random points, of these ± 4.
    directions, _, _ = penrose(constant(64), 3000)
    counts = np.bincount((directions @ spread_directions(48).T).argmax(axis=1), minlength=48)
    areas = np.bincount(
        (spread_directions(100_000) @ spread_directions(48).T).argmax(axis=1), minlength=48
    )
    assert np.std(counts - 3000 * areas / 100_000) < 5


def test_a_source_beyond_the_table_has_its_share_of_the_lights():
    environment_map = sun_in_sky(sun=1e3)
    light = environment_map.radiance[..., 1] * solid_angles(16)[:, None]
    row, column = np.unravel_index(light.argmax(), light.shape)
    directions, _, _ = penrose(environment_map, 2000)
    found = np.round(direction_to_grid(directions, 16)).astype(int)
    in_sun = (found[:, 0] % 32 == column) & (found[:, 1] == row)
    assert abs(in_sun.mean() - light.max() / light.sum()) < 0.01
