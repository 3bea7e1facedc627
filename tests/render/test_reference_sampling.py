"""What the reference draws: directions by light and by reflection, against their densities."""

import math

import numpy as np
import pytest
from numba import njit

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from lighting.sphere.latlong import direction_to_grid, grid_to_direction, solid_angles
from render.reference.emitters import arriving, draw_pool, emitters_of
from render.reference.irradiance import CORNERS, irradiance_of, set_corners
from render.reference.reflection import drawn, reflected
from render.reference.surfaces import ALPHA2, FIELDS, NORMAL, TO_EYE
from tests.chi2 import chi_square_p_value
from tests.render.light_sets import uniform_fill

COUNT = 1 << 14


def uneven_map(rows=8):
    rng = np.random.default_rng(0)
    radiance = rng.random((rows, 2 * rows, 3)) ** 4 * [1.0, 2.0, 0.5]
    radiance[2, 5] = 0.0
    seen = np.ones((rows, 2 * rows), bool)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


def two_discs(fill=0.0):
    directions = np.array([[0.6, 0.8, 0.0], [0.0, 0.1, math.sqrt(0.99)]])
    irradiance = np.array([[3.0, 2.0, 1.0], [1.0, 1.0, 4.0]])
    return LightSet(directions, irradiance, np.array([0.2, 0.0]), fill=uniform_fill(fill))


def cells_of(directions, rows):
    column, row = np.rint(direction_to_grid(directions, rows)).astype(int).T
    return np.clip(row, 0, rows - 1), column % (2 * rows)


@pytest.mark.parametrize("light", [uneven_map(), two_discs(), two_discs(fill=0.5)])
def test_weights_sum_to_the_light(light):
    pool = draw_pool(emitters_of(light, above_horizon=False), COUNT, np.random.default_rng(1))
    np.testing.assert_allclose(pool[:, 3:6].mean(axis=0), light.integral(), rtol=2e-3)


def test_directions_come_from_cells_as_often_as_their_density_says():
    light = uneven_map()
    emitters = emitters_of(light, above_horizon=False)
    pool = draw_pool(emitters, COUNT, np.random.default_rng(2))
    row, column = cells_of(pool[:, :3], light.height)
    observed = np.zeros((8, 16), int)
    np.add.at(observed, (row, column), 1)
    expected = COUNT * emitters.density * solid_angles(8)[:, None]
    assert expected.sum() == pytest.approx(COUNT)
    assert chi_square_p_value(observed, expected) > 1e-3
    edge = np.abs(direction_to_grid(pool[:, :3], 8) % 1 - 0.5).min(axis=1) < 1e-4  # float32
    np.testing.assert_array_equal(pool[~edge, 6], emitters.density[row, column][~edge])
    # Even in solid angle: the cosine of the polar angle is even within a row.
    edges = np.cos(np.pi * np.array([0, 1]) / 8)
    share = (pool[row == 0, 1] - edges[1]) / (edges[0] - edges[1])
    assert share.mean() == pytest.approx(0.5, abs=5 / math.sqrt(12 * (row == 0).sum()))


def test_directions_of_a_disc_are_even_in_solid_angle():
    light = two_discs()
    pool = draw_pool(emitters_of(light, above_horizon=False), COUNT, np.random.default_rng(3))
    wide = pool[:, 6] < 1e20
    lowered = 1 - pool[wide, :3].astype(float) @ light.directions[0]
    share = lowered / (1 - math.cos(0.2))
    assert share.min() > -1e-5
    assert share.max() < 1 + 1e-4
    assert share.mean() == pytest.approx(0.5, abs=5 / math.sqrt(12 * wide.sum()))
    around = pool[wide, :3] - (1 - lowered)[:, None] * light.directions[0]
    assert np.linalg.norm(around.mean(axis=0)) < 5 * 0.2 / math.sqrt(wide.sum())
    np.testing.assert_allclose(
        pool[~wide, :3], np.tile(light.directions[1], (sum(~wide), 1)), atol=1e-7
    )


def test_runs_of_the_pool_lie_close_together():
    light = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), fill=uniform_fill(1.0))
    pool = draw_pool(emitters_of(light, above_horizon=False), COUNT, np.random.default_rng(4))
    runs = pool[:, :3].reshape(64, -1, 3)
    # The mean of directions spread evenly over 4π/64 sr is at least 0.98 long for a cap.
    assert np.linalg.norm(runs.mean(axis=1), axis=1).mean() > 0.93


def test_nothing_from_below_the_horizon_has_weight():
    for light in (uneven_map(rows=7), two_discs(fill=0.5)):
        pool = draw_pool(emitters_of(light, above_horizon=True), COUNT, np.random.default_rng(5))
        below = pool[:, 1] <= 0
        assert not pool[below, 3:6].any()
        assert below.mean() < 0.25  # half of the middle row of seven


@njit
def arrives(emitters, directions, density, out):
    for i in range(len(directions)):
        arriving(emitters, directions[i, 0], directions[i, 1], directions[i, 2], density, out[i])


def test_what_arrives_is_radiance_times_the_share_of_each_cell_and_disc():
    light = uneven_map()
    emitters = emitters_of(light, above_horizon=False)
    rng = np.random.default_rng(6)
    at = rng.integers((16, 8), size=(50, 2)) + rng.uniform(-0.49, 0.49, (50, 2))
    row, column = cells_of(grid_to_direction(at, 8), 8)
    out = np.zeros((50, 3), np.float32)
    arrives(emitters, grid_to_direction(at, 8), 0.3, out)
    share = 0.3 / (0.3 + emitters.density[row, column])
    np.testing.assert_allclose(out, share[:, None] * light.radiance[row, column], rtol=1e-5)

    lights = two_discs(fill=0.5)
    emitters = emitters_of(lights, above_horizon=False)
    density = float(emitters.discs[0, 7])
    arrives(emitters, lights.directions, density, out)
    of_fill = 0.5 * density / (density + emitters.density[0, 0])
    solid_angle = 2 * np.pi * (1 - math.cos(0.2))
    np.testing.assert_allclose(
        out[0], of_fill + 0.5 * lights.irradiance[0] / solid_angle, rtol=1e-4
    )
    np.testing.assert_allclose(out[1], of_fill, rtol=1e-4)  # a point is never met


@njit
def draw_many(surface, points, out):
    for k in range(len(points)):
        x, y, z = drawn(surface, 0, points[k, 0], points[k, 1])
        out[k, 0], out[k, 1], out[k, 2] = x, y, z


@njit
def densities(surface, directions, out):
    for k in range(len(directions)):
        out[k] = reflected(surface, 0, directions[k, 0], directions[k, 1], directions[k, 2])[2]


@pytest.mark.parametrize(("roughness", "slant"), [(0.5, 0.3), (0.9, 1.2)])
def test_directions_drawn_by_a_lobe_have_its_density(roughness, slant):
    surface = np.zeros((FIELDS, 16), np.float32)
    normal = np.array([0.48, -0.6, 0.64])
    side = np.array([0.8, 0.0, -0.6])
    across = np.cross(normal, side)
    surface[NORMAL : NORMAL + 3, 0] = normal
    surface[TO_EYE : TO_EYE + 3, 0] = math.cos(slant) * normal + math.sin(slant) * side
    surface[ALPHA2] = roughness**4
    out = np.zeros((COUNT, 3))
    draw_many(surface, np.random.default_rng(7).random((COUNT, 2)), out)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1, atol=1e-5)
    up = out @ normal
    turn = np.arctan2(out @ across, out @ side) % (2 * np.pi)
    above = up > 0
    observed, *_ = np.histogram2d(up[above], turn[above], (8, 12), [(0, 1), (0, 2 * np.pi)])

    fine = 40  # midpoints a side of each bin
    levels, turns = np.meshgrid(
        (np.arange(8 * fine) + 0.5) / (8 * fine),
        2 * np.pi * (np.arange(12 * fine) + 0.5) / (12 * fine),
        indexing="ij",
    )
    level = np.sqrt(1 - levels**2)[..., None]
    places = levels[..., None] * normal + level * (
        np.cos(turns)[..., None] * side + np.sin(turns)[..., None] * across
    )
    density = np.zeros(levels.size)
    densities(surface, places.reshape(-1, 3), density)
    of_bins = density.reshape(8, fine, 12, fine).mean(axis=(1, 3)) * 2 * np.pi / (8 * 12)
    counted = np.append(observed.ravel(), COUNT - above.sum()).astype(int)
    expected = COUNT * np.append(of_bins.ravel(), 1 - of_bins.sum())
    assert 0 <= expected[-1] < COUNT / 2
    assert chi_square_p_value(counted, expected) > 1e-3


@njit
def corners_of(smooth, surface, corners):
    return set_corners(smooth, surface, 0, corners)


def test_corners_stand_for_a_normal_and_its_irradiance():
    coefficients = np.random.default_rng(8).normal(size=(9, 3)) * 0.05
    coefficients[0] = 1.0
    light = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), fill=coefficients)
    pool = draw_pool(emitters_of(light, above_horizon=False), COUNT, np.random.default_rng(9))
    smooth = irradiance_of(pool)
    surface, corners = np.zeros((FIELDS, 16), np.float32), np.zeros((CORNERS, 16), np.float32)
    for normal in ([0, 1, 0], [0, -1, 0], [0.6, 0.0, -0.8], [-0.3, -0.9, 0.316228]):
        surface[NORMAL : NORMAL + 3, 0] = normal
        told = corners_of(smooth, surface, corners)
        cosines = np.maximum(pool[:, :3] @ corners[:, 0].reshape(4, 3).T, 0).sum(axis=1)
        # The law that makes them a control variate, to rounding …
        np.testing.assert_allclose(told, (cosines[:, None] * pool[:, 3:6]).mean(axis=0), rtol=1e-5)
        # … and what makes them a good one.
        exact = harmonics.irradiance(coefficients, np.array(normal, float))
        np.testing.assert_allclose(told, exact, rtol=0.01)
