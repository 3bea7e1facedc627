"""The Q2-tree's grid: equal areas, nested, compact; and lights counted by hand."""

import numpy as np
import pytest

from lighting.measures.error_measures import spread_directions
from lighting.methods.q2_tree import q2_tree, quadrilateral_codes
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import constant, environment

LEVELS = 26


@pytest.mark.parametrize("level", [0, 1, 2])
def test_quadrilaterals_have_equal_areas(level):
    # Spread directions fill each to within the points on its outline, about 4 √n of n.
    numbers = quadrilateral_codes(spread_directions(200_000)) >> 2 * (LEVELS - level)
    counts = np.bincount(numbers, minlength=12 * 4**level)
    assert len(counts) == 12 * 4**level
    mean = 200_000 / len(counts)
    assert np.abs(counts - mean).max() < 0.4 * np.sqrt(mean)


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_quadrilaterals_are_compact(level):
    directions = spread_directions(200_000)
    numbers = quadrilateral_codes(directions) >> 2 * (LEVELS - level)
    means = np.stack([np.bincount(numbers, directions[:, k]) for k in range(3)], axis=1)
    means /= np.linalg.norm(means, axis=1)[:, None]
    reach = np.arccos((directions * means[numbers]).sum(axis=1)).max()
    # A disc of the same area has the radius 2/√12 2⁻ˡᵉᵛᵉˡ; a corner of a square is 1.25 of it,
    # the farthest here 1.75.
    assert reach < 1.85 * 2 / np.sqrt(12) / 2**level


def test_poles_and_axes_have_a_quadrilateral():
    faces = quadrilateral_codes(np.vstack([np.eye(3), -np.eye(3)])) >> 2 * LEVELS
    assert set(faces[[1]]) <= {0, 1, 2, 3}
    assert set(faces[[4]]) <= {8, 9, 10, 11}
    assert set(faces[[0, 2, 3, 5]]) == {4, 5, 6, 7}


@pytest.mark.parametrize("count", [12, 48, 192])
def test_an_even_sky_has_a_light_in_each_quadrilateral_of_a_level(count):
    directions, irradiance, _ = q2_tree(constant(128), count)
    numbers = quadrilateral_codes(directions) >> 2 * (
        LEVELS - round(np.log(count / 12) / np.log(4))
    )
    assert len(set(numbers)) == count
    # Blocks astride a border belong to one side, and count as a whole.
    np.testing.assert_allclose(irradiance, 4 * np.pi / count, rtol=0.05)


@pytest.mark.parametrize(("power", "of_the_face"), [(1.3, 2), (1.5, 1)])
def test_what_is_parted_next_has_the_most_power_and_size(power, of_the_face):
    # A face of power 1, and a quarter of another: a quarter of its size is 4^¼ = 1.41 times less
    # worth parting. Power alone would part the quarter from 1 on, ω^½ only from 2 on.
    numbers = quadrilateral_codes(cell_directions(64).reshape(-1, 3)).reshape(64, 128)
    radiance = np.zeros((64, 128))
    for is_in, flux in (
        (numbers >> 2 * LEVELS == 4, 1.0),
        (numbers >> 2 * (LEVELS - 1) == 4 * 5 + 2, power),
    ):
        radiance[is_in] = flux / (solid_angles(64) @ is_in.sum(axis=1))
    directions, _, _ = q2_tree(environment(radiance), 3)
    assert (quadrilateral_codes(directions) >> 2 * LEVELS == 4).sum() == of_the_face
