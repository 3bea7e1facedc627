"""What estimators draw: directions as often as their density says, weights that sum to 1."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from lighting.maps.environment import luminance
from lighting.sphere.latlong import direction_to_grid, solid_angles
from render.estimators.block_response import respond
from render.estimators.environment_sampling import share_out
from render.estimators.light_runs import draw_from_run, light_runs
from render.estimators.lobes import draw_reflected, mirror_share, reflected_density
from render.estimators.map_blocks import add_up_levels, map_blocks, start, warp
from render.estimators.map_tables import draw_from_map, map_tables
from render.estimators.multiple_importance import BALANCE, POWER, allocation, weight
from render.estimators.points import hammersley, net, shift_of
from render.estimators.shading import CARRIED, FIELDS, TOWARD, reflect
from render.rays.embree import PACKET
from render.reference.surfaces import NORMAL, TO_EYE
from tests.chi2 import chi_square_p_value
from tests.render import estimator_scene
from tests.render.brute_force import reflectance

COUNT = 1 << 13
ROWS = 8


@njit
def draw_map(tables, points, out):
    for s in range(len(points)):
        _, _, x, y, z = draw_from_map(tables, points[s, 0], points[s, 1])
        out[s, 0], out[s, 1], out[s, 2] = x, y, z


@njit
def draw_warped(blocks, product, points, out):
    for s in range(len(points)):
        _, _, _, x, y, z = warp(blocks, product, points[s, 0], points[s, 1])
        out[s, 0], out[s, 1], out[s, 2] = x, y, z


@njit
def draw_runs(runs, run, points, out):
    for s in range(len(points)):
        _, x, y, z = draw_from_run(runs, run[s], points[s, 0], points[s, 1])
        out[s, 0], out[s, 1], out[s, 2] = x, y, z


@njit
def draw_lobes(surface, i, points, out):
    share = mirror_share(surface, i)
    for s in range(len(points)):
        x, y, z = draw_reflected(surface, i, share, points[s, 0], points[s, 1])
        out[s, 0], out[s, 1], out[s, 2] = x, y, z


@njit
def lobe_density(surface, i, toward, out):
    share = mirror_share(surface, i)
    for s in range(len(toward)):
        out[s] = reflected_density(surface, i, share, toward[s, 0], toward[s, 1], toward[s, 2])


def counts_of(directions, rows=ROWS):
    column, row = np.rint(direction_to_grid(directions, rows)).astype(int).T
    counts = np.zeros((rows, 2 * rows), int)
    np.add.at(counts, (np.clip(row, 0, rows - 1), column % (2 * rows)), 1)
    return counts


def random_points(seed):
    return np.random.default_rng(seed).random((COUNT, 2))


def power_of(light):
    return luminance(light.radiance) * solid_angles(light.height)[:, None]


@pytest.mark.parametrize("is_compensated", [False, True])
def test_the_map_is_drawn_as_its_density_says(is_compensated):
    light = estimator_scene.uneven_map(ROWS)
    tables = map_tables(light, is_compensated=is_compensated)
    expected = tables.density * solid_angles(ROWS)[:, None]
    assert expected.sum() == pytest.approx(1)
    expected = expected / expected.sum()
    out = np.zeros((COUNT, 3))
    draw_map(tables, random_points(1), out)
    assert chi_square_p_value(counts_of(out), COUNT * expected) > 1e-3
    brightness = luminance(light.radiance)
    mean = float(solid_angles(ROWS) @ brightness.sum(axis=1)) / (4 * np.pi)
    wanted = np.maximum(brightness - mean * is_compensated, 0)
    np.testing.assert_allclose(
        tables.density / tables.density.max(), wanted / wanted.max(), atol=1e-6
    )


def test_nothing_is_left_to_draw_of_a_black_or_even_map():
    assert not map_tables(estimator_scene.environment(np.zeros((4, 8, 3)))).density.any()
    even = estimator_scene.environment(np.ones((4, 8, 3)))
    left = map_tables(even, is_compensated=True).density
    assert np.isfinite(left).all()


@pytest.mark.parametrize(
    "rows", [ROWS, 48]
)  # the second: blocks of several cells, some off the map
def test_points_are_warped_to_the_product(rows):
    light = estimator_scene.uneven_map(rows)
    blocks = map_blocks(light)
    first, count = start(blocks.level), len(blocks.directions)
    response = np.random.default_rng(2).random(count) * (np.arange(count) % 7 > 0)
    product = np.zeros(start(blocks.level + 1))
    product[first:] = response * blocks.light[first : first + count]
    add_up_levels(product, blocks.level)
    out = np.zeros((COUNT, 3))
    draw_warped(blocks, product, random_points(3), out)
    side = (1 << blocks.levels) >> blocks.level
    row, column = np.mgrid[:rows, : 2 * rows] // side
    expected = power_of(light) * response[row * (2 << blocks.level) + column]
    expected *= COUNT / expected.sum()
    assert chi_square_p_value(counts_of(out, rows), expected) > 1e-3


def test_a_hierarchy_s_top_holds_all_light():
    light = estimator_scene.uneven_map(12)
    blocks = map_blocks(light)
    assert blocks.light[0] + blocks.light[1] == pytest.approx(power_of(light).sum())


@pytest.mark.parametrize("rows", [ROWS, 48])
def test_runs_hold_all_light_and_are_drawn_by_it(rows):
    light = estimator_scene.uneven_map(rows)
    runs = light_runs(light)
    assert runs.power.sum() == pytest.approx(power_of(light).sum())
    solid_angle = np.repeat(solid_angles(rows), 2 * rows)[runs.cells]
    np.testing.assert_allclose(np.add.reduceat(runs.density * solid_angle, runs.starts[:-1]), 1)
    rng = np.random.default_rng(4)
    run = rng.choice(len(runs.power), COUNT, p=runs.power / runs.power.sum())
    out = np.zeros((COUNT, 3))
    draw_runs(runs, run, rng.random((COUNT, 2)), out)
    expected = power_of(light) * (COUNT / power_of(light).sum())
    assert chi_square_p_value(counts_of(out, rows), expected) > 1e-3
    toward = np.array(runs.directions[run], float)
    assert np.arccos(np.clip((toward * out).sum(axis=1), -1, 1)).max() < 3 * runs.radius_rad


def test_strata_share_out_all_light():
    light = estimator_scene.uneven_map(ROWS)
    for method in ("structured", "kollig-keller", "penrose"):
        with estimator_scene.occluders() as held:
            strata = share_out(method, estimator_scene.setting(light, held), 12)
        assert sorted(strata.cells) == list(np.flatnonzero(power_of(light)))
        assert strata.power.sum() == pytest.approx(power_of(light).sum())
        inside = np.split(power_of(light).ravel()[strata.cells], strata.starts[1:-1])
        np.testing.assert_allclose([cells.sum() for cells in inside], strata.power)
        np.testing.assert_allclose(
            np.concatenate([np.cumsum(cells) / cells.sum() for cells in inside]), strata.cumulative
        )


@pytest.mark.parametrize("i", [0, 1, 2])  # matt, metal, plastic
def test_the_brdf_is_drawn_as_its_density_says(i):
    surface = estimator_scene.packet()[0]
    out = np.zeros((COUNT, 3))
    draw_lobes(surface, i, random_points(5 + i), out)
    normal = surface[NORMAL : NORMAL + 3, i]
    above = out @ normal > 0
    n = 16
    fine = 0.5 / n + np.arange(ROWS * n) / n - 0.5, 0.5 / n + np.arange(2 * ROWS * n) / n - 0.5
    column, row = np.meshgrid(fine[1], fine[0])
    theta, phi = np.pi * (row + 0.5) / ROWS, np.pi - np.pi * (column + 0.5) / ROWS
    toward = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    ).reshape(-1, 3)
    density = np.zeros(len(toward))
    lobe_density(surface, i, toward, density)
    density *= np.repeat(solid_angles(ROWS * n), 2 * ROWS * n)
    expected = density.reshape(ROWS, n, 2 * ROWS, n).sum(axis=(1, 3))
    assert expected.sum() <= 1.001
    counted = np.append(counts_of(out[above]).ravel(), (~above).sum())
    # What falls below the surface is the rest; of quadrature, next to nothing.
    wanted = np.append(COUNT * expected.ravel(), 0.0)
    wanted[-1] = COUNT - wanted.sum() if i else 0.0
    wanted *= COUNT / wanted.sum()
    assert chi_square_p_value(counted, wanted) > 1e-3


@given(st.floats(1e-20, 1e20), st.floats(0, 1e20), st.sampled_from([BALANCE, POWER]))
@settings(max_examples=60, deadline=None)
def test_weights_sum_to_one(mine, other, heuristic):
    assert 0 <= weight(mine, other, heuristic) <= 1
    if other > 0:
        both = weight(mine, other, heuristic) + weight(other, mine, heuristic)
        assert both == pytest.approx(1)
    else:
        assert weight(mine, other, heuristic) == 1


@given(st.integers(1, 500), st.floats(0, 1))
@settings(max_examples=60, deadline=None)
def test_every_way_with_a_share_draws(samples, share):
    by_light = allocation(samples, share)
    assert abs(by_light - samples * share) <= 1
    if samples == 1:
        assert by_light == share  # a chance
    else:
        assert by_light == round(by_light)
        assert (0 < by_light < samples) == (0 < share < 1)


def test_directions_carry_what_the_textbook_reflects():
    surface = estimator_scene.packet()[0]
    rng = np.random.default_rng(10)
    light = np.zeros((FIELDS, 16), np.float32)
    for _ in range(20):
        toward = rng.normal(size=(3, 16))
        light[TOWARD : TOWARD + 3] = toward / np.linalg.norm(toward, axis=0)
        light[CARRIED : CARRIED + 3] = np.array([[1.0], [2.0], [3.0]])
        with estimator_scene.occluders() as held:
            shadows = estimator_scene.setting(estimator_scene.uneven_map(), held).shadows
        reflect(shadows, surface, light)
        for i in range(15):
            normal, eye = surface[NORMAL : NORMAL + 3, i], surface[TO_EYE : TO_EYE + 3, i]
            f = reflectance(estimator_scene.MATERIALS[i % 3], normal, eye, light[:3, i])
            cosine = max(float(normal @ light[:3, i]), 0.0)
            np.testing.assert_allclose(
                light[CARRIED : CARRIED + 3, i], f * cosine * [1, 2, 3], rtol=2e-3, atol=1e-6
            )
        assert not light[CARRIED:, 15].any()


@pytest.mark.parametrize("points", [net(64), hammersley(64)])
def test_points_lie_one_in_each_elementary_box(points):
    unit = points / 2.0**32
    for a in range(7):
        box = np.floor(unit[:, 0] * 2**a) * 2 ** (6 - a) + np.floor(unit[:, 1] * 2 ** (6 - a))
        assert len(set(box)) == 64


def test_a_response_is_positive_wherever_a_block_can_light():
    surface = estimator_scene.packet()[0]
    radius = 0.14
    out = np.zeros(16, np.float32)
    rng = np.random.default_rng(9)
    for _ in range(200):
        middle = rng.normal(size=3)
        middle /= np.linalg.norm(middle)
        x, y, z = middle.astype(np.float32)
        respond(surface, x, y, z, np.float32(radius), out)
        reaches = surface[NORMAL : NORMAL + 3].T @ middle > -math.sin(radius) + 1e-6
        assert np.all(out[:15][reaches[:15]] > 0)
        assert np.all(out[:15][surface[NORMAL : NORMAL + 3, :15].T @ middle < -radius] == 0)
        assert out[15] == 0


def test_each_of_many_points_of_a_surface_has_a_shift_of_its_own():
    shifts = {shift_of(0, 31, i) for i in range(64 * PACKET)}
    assert len(shifts) == 64 * PACKET
