"""Median cut, variance minimisation and cells: a plain numpy version as the oracle, and by hand."""

import numpy as np
import pytest

from lighting.blocks.summed_area import block_sums, summed_area_tables
from lighting.cells.cell_splitting import cut_variances, parts
from lighting.methods.cells import cells
from lighting.methods.median_cut import median_cut
from lighting.methods.variance_minimisation import variance_minimisation
from lighting.sphere.latlong import cell_directions
from tests.environments import constant, environment, one_hot, outdoors, turned, two_cells

CELL_METHODS = pytest.mark.parametrize("method", [median_cut, variance_minimisation, cells])


def plain_variance(sums):
    return sums[0] - sums[1:4] @ sums[1:4] / sums[0]


def plain_lights(blocks, count, cost, priority, both_sides):
    """Return direction and irradiance of each cell, from sums over whole arrays at every step."""
    found = [(blocks, 0)]  # a cell's own blocks, and its first row in the map
    while len(found) < count:
        index = max(
            (i for i, (cell, _) in enumerate(found) if cell[..., 0].size > 1),
            key=lambda i: priority(found[i][0].sum(axis=(0, 1))),
        )
        cell, top = found[index]
        height, width, _ = cell.shape
        between_columns = [(top, cell[:, :c], cell[:, c:]) for c in range(1, width)]
        between_rows = [(top + r, cell[:r], cell[r:]) for r in range(1, height)]
        if both_sides:
            cuts = between_columns + between_rows
        elif width * np.sin(np.pi / len(blocks) * (top + height / 2)) >= height:
            cuts = between_columns or between_rows
        else:
            cuts = between_rows or between_columns
        second_top, first, second = min(
            cuts, key=lambda cut: cost(cut[1].sum(axis=(0, 1)), cut[2].sum(axis=(0, 1)))
        )
        found[index] = (first, top)
        found.append((second, second_top))
    sums = np.array([cell.sum(axis=(0, 1)) for cell, _ in found])
    centroids = sums[:, 1:4]
    return centroids / np.linalg.norm(centroids, axis=1)[:, None], sums[:, 4:]


PLAIN = {
    median_cut: (lambda a, b: abs(a[0] - b[0]), lambda s: s[0], False),
    variance_minimisation: (
        lambda a, b: max(plain_variance(a), plain_variance(b)),
        plain_variance,
        True,
    ),
    cells: (
        lambda a, b: plain_variance(a) + plain_variance(b),
        lambda s: s[0] * plain_variance(s),
        True,
    ),
}


@CELL_METHODS
@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_agrees_with_plain_numpy(method, count):
    # The texture is noise all over, so that no two cuts or cells are equally good.
    texture = np.random.default_rng(3).lognormal(0, 1, (24, 48, 3))
    environment_map = environment(outdoors(24).radiance * texture)
    cost, priority, both_sides = PLAIN[method]
    blocks = block_sums(environment_map.radiance)
    expected = plain_lights(blocks, count, cost, priority, both_sides)
    directions, irradiance, _ = method(environment_map, count)
    np.testing.assert_allclose(directions, expected[0], atol=1e-9)
    np.testing.assert_allclose(irradiance, expected[1], rtol=1e-9)


def test_cuts_are_numbered_between_columns_first():
    cell = (2, 4, 10, 13)
    assert parts(cell, 0) == ((2, 4, 10, 11), (2, 4, 11, 13))
    assert parts(cell, 1) == ((2, 4, 10, 12), (2, 4, 12, 13))
    assert parts(cell, 2) == ((2, 3, 10, 13), (3, 4, 10, 13))


def test_no_cut_leaves_a_part_dark():
    # Lit columns 2 and 4 of 8, row 1 of 4: of the cuts before columns 1 to 7 those before 3 and 4
    # have light on both sides, and none between rows.
    radiance = np.zeros((4, 8))
    radiance[1, [2, 4]] = 1.0, 1e-30
    tables = summed_area_tables(block_sums(environment(radiance).radiance))
    is_possible = np.isfinite(cut_variances(*tables, (0, 4, 0, 8))).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(is_possible), [2, 3])


@CELL_METHODS
def test_a_constant_map_is_cut_into_octants(method):
    # Any cut through the middle is as good as another to the last bit, but eight lights are equal.
    _, irradiance, _ = method(constant(16), 8)
    np.testing.assert_allclose(irradiance, np.pi / 2, rtol=1e-6)


@CELL_METHODS
@pytest.mark.parametrize("rows", [1, 3, 8])
def test_a_disc_has_its_own_radius(method, rows):
    # Rows next to the pole are a disc around +Y, of radius rows · π/16.
    radiance = np.zeros((16, 32))
    radiance[:rows] = 2.0
    directions, irradiance, angular_radius_rad = method(environment(radiance), 1)
    np.testing.assert_allclose(directions, [[0, 1, 0]], atol=1e-12)
    assert angular_radius_rad[0] == pytest.approx(rows * np.pi / 16, rel=1e-9)
    solid_angle = 2 * np.pi * (1 - np.cos(rows * np.pi / 16))
    np.testing.assert_allclose(irradiance, 2 * solid_angle, rtol=1e-6)


@CELL_METHODS
def test_light_from_everywhere_is_one_light_from_above_as_wide_as_a_hemisphere(method):
    directions, irradiance, angular_radius_rad = method(constant(), 1)
    np.testing.assert_array_equal(directions, [[0, 1, 0]])
    np.testing.assert_allclose(irradiance, 4 * np.pi, rtol=1e-6)
    assert angular_radius_rad[0] == pytest.approx(np.pi / 2)


@CELL_METHODS
def test_one_cell_is_one_light_of_its_size(method):
    directions, irradiance, angular_radius_rad = method(one_hot(16, (5, 7)), 9)
    assert len(directions) == 1
    np.testing.assert_allclose(directions[0], cell_directions(16)[5, 7], atol=2e-3)
    np.testing.assert_allclose(irradiance[0], one_hot(16, (5, 7)).integral(), rtol=1e-6)
    # A square of side s has the second moment s²/6, a disc r²/2: r = s/√3, here π/16/√3 = 0.1134
    # high and a little less wide.
    assert angular_radius_rad[0] == pytest.approx(0.11, abs=0.004)


@CELL_METHODS
def test_two_cells_are_two_lights_of_their_own_colour(method):
    # At whatever place, however far apart in brightness: their rectangle holds dark only.
    for columns in (0, 5, 16):
        _, irradiance, _ = method(turned(two_cells(), columns), 64)
        assert len(irradiance) == 2
        assert sorted(np.count_nonzero(irradiance, axis=1)) == [1, 1]


@CELL_METHODS
@pytest.mark.parametrize("axis", [0, 1])
def test_lights_in_one_row_or_column_are_told_apart(method, axis):
    # Median cut's longer side may hold them all between two of its cuts.
    radiance = np.zeros((16, 32))
    for position in (3, 4, 9):
        radiance[(position, 6) if axis == 0 else (6, position)] = 1.0 + position
    _, irradiance, _ = method(environment(radiance), 3)
    assert len(irradiance) == 3


@pytest.mark.parametrize("method", [variance_minimisation, cells])
def test_a_bright_and_a_dim_lamp_get_a_light_each(method):
    # What the poster of variance minimisation shows: median cut passes through the bright one
    # (tests/limits/test_median_cut_source.py).
    radiance = np.zeros((32, 64))
    radiance[12:16, 10:14], radiance[12:16, 24:28] = 6.0, 1.0
    lamps = cell_directions(32)[12:16, [10, 11, 12, 13, 24, 25, 26, 27]].reshape(4, 2, 4, 3)
    directions, irradiance, _ = method(environment(radiance), 2)
    order = np.argsort(-irradiance[:, 0])
    np.testing.assert_allclose(irradiance[order[0]] / irradiance[order[1]], 6, rtol=1e-6)
    for light, lamp in zip(directions[order], (lamps[:, 0], lamps[:, 1]), strict=True):
        middle = lamp.mean(axis=(0, 1))
        assert light @ middle / np.linalg.norm(middle) > np.cos(np.radians(0.2))


@CELL_METHODS
def test_dark_cells_beside_a_very_bright_one_keep_their_light(method):
    # Tables alone would lose these: 1e-20 of the sun is below the rounding of its entries.
    radiance = np.full((16, 32), 1e-8)
    radiance[4, 5] = 1e12
    directions, irradiance, _ = method(environment(radiance), 40)
    assert np.isfinite(directions).all()
    assert len(irradiance) == 40
    sky = np.sort(irradiance[:, 0])[:-1].sum()
    assert sky == pytest.approx(4 * np.pi * 1e-8, rel=0.02)


def test_the_largest_count_is_served_on_a_large_map():
    directions, irradiance, _ = cells(outdoors(256), 65536)
    assert len(directions) == 65536
    np.testing.assert_allclose(irradiance.sum(axis=0), outdoors(256).integral(), rtol=1e-6)
