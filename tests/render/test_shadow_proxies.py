"""Shadow proxies: fewer triangles, closed and as near to what they stand for as they say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from render.scenes.casters import gather_casters, is_closed, signed_volume
from render.scenes.default_scene import sphere, torus
from render.scenes.scene import Material, Mesh
from render.scenes.shadow_proxies import shadow_proxy

MATT = Material()
BALL = sphere((1.0, 2.0, 3.0), 0.5, MATT, rings=32)
RING = torus((0.0, 1.0, 0.0), 1.0, 0.2, MATT, segments=48)


def casters_of(*meshes):
    return gather_casters(meshes)


def grid(n, height=None):
    """Unit square in the plane y = 0, or a surface over it, as 2 n² triangles."""
    x, z = np.meshgrid(*[np.linspace(0, 1, n + 1)] * 2, indexing="ij")
    y = np.zeros_like(x) if height is None else height(x, z)
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    a, b, c, d = corner, corner + 1, corner + n + 2, corner + n + 1
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).astype(np.int32)
    return Mesh(positions, np.tile(np.float32([0, 1, 0]), (len(positions), 1)), faces, MATT)


def corners_of(casters):
    faces = np.concatenate([casters.closed_faces, casters.open_faces])
    return casters.positions.astype(np.float64)[faces]


def area_vectors(casters):
    a, b, c = corners_of(casters).transpose(1, 0, 2)
    return 0.5 * np.cross(b - a, c - a)


def farthest(points, casters):
    """How far at most points (P, 3) are from the nearest triangle."""
    distances = [_distances(points, *corners) for corners in corners_of(casters)]
    return float(np.min(distances, axis=0).max())


def _distances(points, *corners):
    """Distances of points from a triangle: to its plane above it, to its edges elsewhere."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    nearest = np.full(len(points), np.inf)
    inside = np.ones(len(points), bool)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        share = np.clip((points - start) @ along / (along @ along), 0, 1)
        nearest = np.minimum(
            nearest, np.linalg.norm(points - start - share[:, None] * along, axis=1)
        )
        inside &= (points - start) @ np.cross(normal, along) >= 0
    return np.where(inside, np.abs((points - a) @ normal), nearest)


@pytest.mark.parametrize(("mesh", "most"), [(BALL, 0.25), (RING, 0.6)])
def test_a_proxy_is_smaller_closed_and_near_both_ways(mesh, most):
    full = casters_of(mesh)
    proxy = shadow_proxy(full, 0.01)
    assert len(proxy.closed_faces) < most * len(full.closed_faces)
    assert len(proxy.open_faces) == 0
    assert is_closed(proxy.closed_faces, len(proxy.positions))
    assert proxy.error_m == 0.01
    assert_array_equal(proxy.centre, full.centre)
    middles = corners_of(full).mean(axis=1)
    assert farthest(np.concatenate([full.positions, middles]), proxy) < 0.01
    middles = corners_of(proxy).mean(axis=1)
    assert farthest(np.concatenate([proxy.positions, middles]), full) < 0.01
    volumes = [signed_volume(each.positions, each.closed_faces) for each in (full, proxy)]
    assert_allclose(volumes[1], volumes[0], rtol=0.01)


@settings(deadline=None, max_examples=6)
@given(st.integers(0, 2**16), st.floats(0.002, 0.05))
def test_of_an_uneven_ball_nothing_is_farther_off_than_it_may_be(seed, error_m):
    bumps = np.random.default_rng(seed).normal(size=(3, 3))
    ball = sphere((0.0, 0.0, 0.0), 1.0, MATT, rings=10)
    radius = 1 + 0.15 * np.sin(3 * ball.positions @ bumps).mean(axis=1, keepdims=True)
    uneven = Mesh((radius * ball.positions).astype(np.float32), ball.normals, ball.faces, MATT)
    full = casters_of(uneven)
    proxy = shadow_proxy(full, error_m)
    assert is_closed(proxy.closed_faces, len(proxy.positions))
    assert farthest(full.positions.astype(np.float64), proxy) <= error_m
    assert farthest(proxy.positions.astype(np.float64), full) <= error_m


def test_what_is_flat_needs_few_triangles_and_its_rim_stays():
    full = casters_of(grid(24))
    proxy = shadow_proxy(full, 1e-4)
    assert len(full.open_faces) == 2 * 24**2
    assert len(proxy.open_faces) < 60
    assert len(proxy.closed_faces) == 0
    areas = area_vectors(proxy)
    assert np.all(areas[:, 1] * area_vectors(full)[0, 1] >= 0)  # none is turned over
    assert_allclose(np.abs(areas[:, 1].sum()), 1, atol=4e-4)
    for corner in ((0, 0, 0), (1, 0, 0), (0, 0, 1), (1, 0, 1)):
        assert np.abs(proxy.positions - corner).max(axis=1).min() < 2e-4


def test_a_round_rim_stays_within_the_error():
    # The half of a ball: its rim is a circle in the plane y = 0.
    half = Mesh(BALL.positions - np.float32([1, 2, 3]), BALL.normals, BALL.faces, MATT)
    upper = half.faces[np.all(half.positions[half.faces][..., 1] > -1e-6, axis=1)]
    proxy = shadow_proxy(casters_of(Mesh(half.positions, half.normals, upper, MATT)), 0.01)
    assert len(proxy.open_faces) < 0.4 * len(upper)
    # Seen from above, the area inside the rim.
    assert_allclose(np.abs(area_vectors(proxy)[:, 1].sum()), np.pi / 4, atol=np.pi * 0.01 + 0.004)
    assert abs(proxy.positions[:, 1].min()) < 0.01


def test_a_crease_and_a_step_stay():
    roof = grid(20, lambda x, z: np.maximum(0.3 - np.abs(x - 0.5), 0))
    full = casters_of(roof)
    proxy = shadow_proxy(full, 0.002)
    assert len(proxy.open_faces) < 0.3 * len(full.open_faces)
    assert abs(proxy.positions[:, 1].max() - 0.3) < 0.002
    assert farthest(full.positions.astype(np.float64), proxy) < 0.002


def test_closed_and_open_meshes_stay_apart():
    proxy = shadow_proxy(casters_of(BALL, grid(12), RING), 0.01)
    assert is_closed(proxy.closed_faces, len(proxy.positions))
    assert signed_volume(proxy.positions, proxy.closed_faces) > 0
    on_grid = proxy.positions[proxy.open_faces]
    assert_allclose(on_grid[..., 1], 0, atol=0.01)


def test_what_is_smaller_than_the_error_is_not_lost():
    proxy = shadow_proxy(casters_of(BALL), 10.0)
    assert 4 <= len(proxy.closed_faces) < 60
    assert is_closed(proxy.closed_faces, len(proxy.positions))
    assert signed_volume(proxy.positions, proxy.closed_faces) > 0


def test_a_tube_thinner_than_the_error_is_not_pinched():
    # Three sides: an edge across them that vanished would leave two edges in one place.
    around = np.arange(48)[:, None] * 3 + np.arange(3)
    angle = 2 * np.pi * np.arange(48) / 48
    turn = 2 * np.pi * np.arange(3) / 3
    radius = 1 + 0.01 * np.cos(turn)
    x, z = (each[:, None] * radius for each in (np.cos(angle), np.sin(angle)))
    y = np.tile(0.01 * np.sin(turn), (48, 1))
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    a, b = around, np.roll(around, -1, axis=1)
    c, d = np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)
    faces = np.concatenate([np.stack(each, -1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))])
    tube = Mesh(positions, np.ones_like(positions), faces.astype(np.int32), MATT)
    full = casters_of(tube)
    assert len(full.closed_faces) == 6 * 48
    proxy = shadow_proxy(full, 0.05)
    assert len(proxy.closed_faces) < 0.5 * 6 * 48
    assert is_closed(proxy.closed_faces, len(proxy.positions))


def test_errors_add_up():
    full = casters_of(BALL)
    fine = shadow_proxy(full, 0.005)
    assert shadow_proxy(fine, 0.005) is fine
    coarse = shadow_proxy(fine, 0.01)
    assert len(coarse.closed_faces) < len(fine.closed_faces)
    assert farthest(full.positions.astype(np.float64), coarse) < 0.01
    assert shadow_proxy(full, 0.0) is full
    empty = casters_of()
    assert shadow_proxy(empty, 1.0) is empty


def test_triangles_without_area_and_edges_of_three_do_no_harm():
    sheet = grid(8)
    last = len(sheet.positions)
    positions = np.concatenate([sheet.positions, np.float32([[0.5, 1, 0], [0.5, 2, 0]])])
    middle = [4 * 9, 4 * 9 + 1]  # an edge inside the sheet, and a fin on it
    faces = np.concatenate(
        [sheet.faces, np.int32([[*middle, last], [0, 40, 80], [last, last + 1, last]])]
    )
    normals = np.tile(np.float32([0, 1, 0]), (len(positions), 1))
    full = casters_of(Mesh(positions, normals, faces, MATT))
    proxy = shadow_proxy(full, 0.01)
    assert 4 < len(proxy.open_faces) < len(full.open_faces)
    assert np.isfinite(proxy.positions).all()
    assert proxy.positions[:, 1].max() == 1  # the fin's tip
