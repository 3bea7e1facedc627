"""Pieces of pixels: closed forms, quadrature, and what tiles the sphere sums to it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.camera import LEVEL, UP, Calibration
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from lighting.latlong import cell_directions, direction_to_grid, solid_angles
from lighting.pixel_grid import pixel_corners
from lighting.pixel_pieces import axis_factors, block_centre, pixel_pieces, polygon_moment

X, Y, Z = np.eye(3)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.linalg.det(q)


def pieces_of(calibration, rows):
    corners, seen = pixel_corners(calibration, 0, calibration.image_size_px[1])
    return pixel_pieces(corners, seen, rows)


def moments(blocks, weights, rows):
    """Return ∫d dω (P, 3) of pieces, from what is stored about the centres of their blocks."""
    centres = cell_directions(rows).reshape(-1, 3)[blocks]
    return weights[:, 1:] + weights[:, :1].astype(np.float64) * centres


def test_an_octant_has_the_moment_of_its_faces():
    # Half the sum of its three quarter discs' areas π/4 × normals, by the divergence theorem.
    np.testing.assert_allclose(polygon_moment(X, Y, Z, Z), np.pi / 4 * np.ones(3), rtol=1e-14)
    np.testing.assert_allclose(polygon_moment(Z, Z, Y, X), np.pi / 4 * np.ones(3), rtol=1e-14)


@settings(deadline=None, max_examples=20)
@given(
    seed=st.integers(0, 99),
    size=st.sampled_from([1e-4, 0.01, 0.3]),
    jitter=st.lists(st.floats(-0.3, 0.3), min_size=8, max_size=8),
)
def test_a_polygon_has_the_moment_of_its_points(seed, size, jitter):
    # Seen from its middle's tangent plane a great circle is a straight line, so points of the
    # plane's quadrilateral, weighted by dω = (1 + ρ²)^(−3/2) dA, cover the polygon exactly.
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) + np.reshape(jitter, (4, 2))
    plane = size * square
    turn = rotation(seed)
    corners = unit(np.column_stack([plane, np.ones(4)])) @ turn.T
    nodes, weights = np.polynomial.legendre.leggauss(8)
    u, v = np.meshgrid((nodes + 1) / 2, (nodes + 1) / 2)
    shape = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
    along_u = np.stack([v - 1, 1 - v, v, -v], axis=-1) @ plane
    along_v = np.stack([u - 1, -u, u, 1 - u], axis=-1) @ plane
    area = along_u[..., 0] * along_v[..., 1] - along_u[..., 1] * along_v[..., 0]
    at = shape @ plane
    density = (1 + (at**2).sum(axis=-1)) ** -1.5 * area * np.outer(weights, weights) / 4
    points = unit(np.concatenate([at, np.ones((8, 8, 1))], axis=-1)) @ turn.T
    expected = np.einsum("uv,uvx->x", density, points)
    np.testing.assert_allclose(polygon_moment(*corners), expected, rtol=1e-8, atol=1e-10 * size**2)


@pytest.mark.parametrize("size_px", [(16, 8), (96, 48), (256, 128)])
@pytest.mark.parametrize("turn", [0, 7], ids=["level", "tilted"])
def test_pixels_of_the_whole_sphere_sum_to_it(size_px, turn):
    # 4π sr without a moment, whether pixels are larger or smaller than blocks.
    R = rotation(turn) if turn else LEVEL
    blocks, _, weights = pieces_of(Calibration(full_sphere(size_px), size_px, np.pi, R), 32)
    assert weights[:, 0].sum(dtype=np.float64) == pytest.approx(4 * np.pi, rel=1e-7)
    np.testing.assert_allclose(moments(blocks, weights, 32).sum(axis=0), 0, atol=1e-6)


@pytest.mark.parametrize("rows", [8, 64])
def test_the_pieces_of_a_pixel_are_its_polygon(rows):
    # 40² px of 4.5°: a fifth of a block of 8 rows, and larger than one of 64.
    camera = Calibration(Equidistant((19.5, 19.5), 40 / np.pi), (40, 40), np.pi / 2, UP)
    corners, seen = pixel_corners(camera, 0, 40)
    blocks, pixels, weights = pixel_pieces(corners, seen, rows)
    summed = np.zeros((40 * 40, 3))
    np.add.at(summed, pixels, moments(blocks, weights, rows))
    for row, column in [(0, 19), (12, 12), (19, 20), (20, 39)]:
        around = [corners[row + j, column + i] for j, i in ((0, 0), (0, 1), (1, 1), (1, 0))]
        np.testing.assert_allclose(
            summed[40 * row + column], polygon_moment(*around), rtol=2e-6, atol=1e-9
        )
    assert (np.bincount(pixels, minlength=1600) > 0).tolist() == seen.ravel().tolist()


def test_a_small_pixel_goes_whole_to_the_block_of_its_middle():
    camera = Calibration(Equidistant((39.2, 39.9), 80 / np.pi), (80, 80), np.pi / 2, UP)
    blocks, pixels, weights = pieces_of(camera, 32)
    np.testing.assert_array_equal(pixels, np.unique(pixels))
    middles = moments(blocks, weights, 32)
    column, row = np.rint(direction_to_grid(middles, 32)).astype(int).T
    np.testing.assert_array_equal(blocks, row * 64 + column % 64)


def test_a_large_pixel_covers_every_block_it_lies_on():
    # Pixels of 22.5° on blocks of 5.6°, edge on edge: all blocks get about their solid angle. Away
    # from the poles, where a pixel's upper and lower sides are no parallels.
    blocks, _, weights = pieces_of(Calibration(full_sphere((16, 8)), (16, 8), np.pi), 32)
    covered = np.bincount(blocks, weights[:, 0], minlength=2048).reshape(32, 64)
    share = covered / solid_angles(32)[:, None]
    np.testing.assert_allclose(share[8:24], 1, atol=0.2)
    assert (covered > 0).all()


def test_block_centres_are_the_centres_of_cells():
    expected = cell_directions(6).reshape(-1, 3)
    factors = axis_factors(6)
    centres = [block_centre(block, *factors) for block in range(72)]
    np.testing.assert_allclose(centres, expected, atol=1e-15)
