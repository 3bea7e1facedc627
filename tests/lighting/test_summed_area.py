"""Sums over rectangles of a lat-long map: closed forms, quadrature, and brute sums as oracles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.blocks.summed_area import (
    block_sums,
    cell_sums,
    rectangle_lit,
    rectangle_moments,
    summed_area_tables,
    variance,
)
from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere.latlong import grid_to_direction
from tests.environments import constant, outdoors, sun_in_sky


def random_map(height, seed):
    rng = np.random.default_rng(seed)
    lit = rng.random((height, 2 * height, 1)) < 0.6
    return (lit * rng.lognormal(0, 3, (height, 2 * height, 3))).astype(np.float32)


@pytest.mark.parametrize("height", [2, 6, 64])
def test_an_octant_has_an_eighth_of_the_sphere_and_the_moment_of_its_faces(height):
    # ∫d dω over an octant is half the sum of its three quarter discs' areas π/4 × normals, by
    # the divergence theorem: (π/4)(±1, ±1, ±1). Exact on any grid with edges on the axes.
    moments, _ = summed_area_tables(block_sums(constant(height).radiance))
    n, q = height // 2, height // 2
    for row, y in ((0, 1), (n, -1)):
        for quarter, (x, z) in enumerate([(1, -1), (1, 1), (-1, 1), (-1, -1)]):
            rectangle = (row, row + n, quarter * q, (quarter + 1) * q)
            power, *moment = rectangle_moments(moments, *rectangle)
            assert power == pytest.approx(np.pi / 2, rel=1e-12)
            np.testing.assert_allclose(moment, np.pi / 4 * np.array([x, y, z]), rtol=1e-12)


@pytest.mark.parametrize("cell", [(0, 0), (0, 9), (5, 3), (7, 0), (15, 31)])
def test_a_cell_has_the_mean_direction_of_its_points(cell):
    height, fine = 16, 200
    radiance = np.zeros((height, 2 * height, 3), np.float32)
    radiance[cell] = (3.0, 2.0, 1.0)
    sums = block_sums(radiance)[cell]
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    rows, columns = np.meshgrid(cell[0] + offsets, cell[1] + offsets, indexing="ij")
    directions = grid_to_direction(np.stack([columns, rows], axis=-1), height)
    weight = np.sin(np.pi * (rows + 0.5) / height) * (np.pi / height / fine) ** 2
    luminance = np.array([3.0, 2.0, 1.0]) @ LUMINANCE_WEIGHTS
    assert sums[0] == pytest.approx(luminance * weight.sum(), rel=1e-4)
    expected = luminance * np.einsum("rc,rcx->x", weight, directions)
    np.testing.assert_allclose(sums[1:4], expected, rtol=1e-4)
    np.testing.assert_allclose(sums[4:], np.array([3.0, 2.0, 1.0]) * weight.sum(), rtol=1e-4)


@settings(deadline=None, max_examples=50)
@given(
    seed=st.integers(0, 99), corners=st.tuples(*[st.integers(0, 12)] * 2, *[st.integers(0, 24)] * 2)
)
def test_a_rectangle_is_the_sum_of_its_blocks(seed, corners):
    (top, bottom), (left, right) = sorted(corners[:2]), sorted(corners[2:])
    blocks = block_sums(random_map(12, seed))
    moments, lit = summed_area_tables(blocks)
    inside = blocks[top:bottom, left:right]
    scale = blocks[..., 0].sum()
    np.testing.assert_allclose(
        rectangle_moments(moments, top, bottom, left, right),
        inside[..., :4].sum(axis=(0, 1)),
        rtol=0,
        atol=1e-13 * scale,
    )
    assert rectangle_lit(lit, top, bottom, left, right) == np.count_nonzero(inside[..., 0])
    summed = cell_sums(blocks, np.array([[top, bottom, left, right]]))
    np.testing.assert_allclose(summed[0], inside.sum(axis=(0, 1)), rtol=1e-12)


def test_variance_is_the_squared_distance_from_the_centroid():
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((500, 3)) + 1
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    weight = rng.random(500)
    mean = weight @ directions / weight.sum()
    expected = weight @ ((directions - mean) ** 2).sum(axis=1)
    assert variance(weight.sum(), *(weight @ directions)) == pytest.approx(expected, rel=1e-12)


def test_variance_is_never_negative():
    # What is left of a dark rectangle beside a sun: rounding errors.
    assert variance(1e-18, 1e-17, 0.0, 0.0) == 0.0
    assert variance(-1e-18, 1e-17, 0.0, 0.0) == 0.0
    assert variance(0.0, 0.0, 0.0, 0.0) == 0.0


@pytest.mark.parametrize("height", [257, 300, 512])
def test_blocks_lose_no_energy_and_move_no_centroid(height):
    radiance = outdoors(height).radiance
    blocks = block_sums(radiance)
    assert blocks.shape[0] <= 256
    cells = block_sums(radiance, height)
    assert cells.shape[:2] == (height, 2 * height)
    side = -(-height // blocks.shape[0])
    for r, c in [(0, 0), (3, 7), (blocks.shape[0] - 1, blocks.shape[1] - 1)]:
        covered = cells[r * side : (r + 1) * side, c * side : (c + 1) * side]
        np.testing.assert_allclose(blocks[r, c], covered.sum(axis=(0, 1)), rtol=1e-12)
    np.testing.assert_allclose(blocks.sum(axis=(0, 1)), cells.sum(axis=(0, 1)), rtol=1e-11)


def test_the_sky_beside_a_sun_keeps_its_own_sums():
    # The sum of the sky's own cells, not a difference of entries that hold the sun.
    blocks = block_sums(sun_in_sky(16, sun=1e30).radiance)
    sky = cell_sums(blocks, np.array([[8, 16, 0, 32]]))[0]
    np.testing.assert_allclose(sky, [2 * np.pi, 0, -np.pi, 0] + [2 * np.pi] * 3, atol=1e-12)
