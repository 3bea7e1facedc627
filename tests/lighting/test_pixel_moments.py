"""What pixels cover: closed forms, quadrature, and what tiles the sphere sums to it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.camera import LEVEL, UP, Calibration
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from lighting.maps.pixel_grid import pixel_corners
from lighting.maps.pixel_moments import pixel_moments, polygon_moment

X, Y, Z = np.eye(3)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.linalg.det(q)


def moments_of(calibration):
    corners, seen = pixel_corners(calibration, 0, calibration.image_size_px[1])
    return pixel_moments(corners, seen)


def test_an_octant_has_the_moment_of_its_faces():
    # Half the sum of its three quarter discs' areas π/4 × normals, by the divergence theorem.
    np.testing.assert_allclose(polygon_moment(X, Y, Z, Z), np.pi / 4 * np.ones(3), rtol=1e-14)
    np.testing.assert_allclose(polygon_moment(Z, Z, Y, X), np.pi / 4 * np.ones(3), rtol=1e-14)


@settings(deadline=None, max_examples=12)
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


@pytest.mark.parametrize("size_px", [(16, 8), (96, 48)])
@pytest.mark.parametrize("turn", [0, 7], ids=["level", "tilted"])
def test_pixels_of_the_whole_sphere_sum_to_it(size_px, turn):
    # 4π sr, without a moment.
    R = rotation(turn) if turn else LEVEL
    solid_angle, moment = moments_of(Calibration(full_sphere(size_px), size_px, np.pi, R))
    assert solid_angle.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    np.testing.assert_allclose(moment.sum(axis=0), 0, atol=1e-12)


def test_pixels_of_a_lens_have_the_solid_angle_of_its_formula():
    # dω = sin θ dθ dφ and r = f θ: sin θ/θ/f² per px² at a centre, exact to the second order.
    size = 200
    camera = Calibration(Equidistant((99.3, 98.6), size / np.pi), (size, size), 1.5, UP)
    corners, seen = pixel_corners(camera, 0, size)
    solid_angle, moment = pixel_moments(corners, seen)
    y, x = np.nonzero(seen)
    theta = np.hypot(x - 99.3, y - 98.6) * np.pi / size
    expected = np.sinc(theta / np.pi) * (np.pi / size) ** 2
    np.testing.assert_allclose(solid_angle, expected, rtol=1e-4)
    directions, _ = camera.unproject(np.stack([x, y], axis=-1))
    np.testing.assert_allclose(unit(moment), directions, atol=1e-4)
    # A square of side s about d has the mean of d shorter by s²/12.
    shorter = 1 - np.linalg.norm(moment, axis=1) / solid_angle
    np.testing.assert_allclose(
        shorter, (1 + np.sinc(theta / np.pi) ** 2) / 24 * (np.pi / size) ** 2, rtol=1e-2
    )
