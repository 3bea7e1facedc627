"""Rays against triangles."""

import numpy as np
import pytest
from numba import njit

from render.rays.embree import (
    PACKET,
    Occluders,
    hit_packet,
    intersect16,
    intersect16_address,
    occluded16,
    occluded16_address,
    packet,
)
from render.scenes.default_scene import sphere
from render.scenes.scene import Material


@njit
def blocked(function, scene, origins, direction, traced):
    rays, valid = packet()
    for i in range(PACKET):
        rays[0, i], rays[1, i], rays[2, i] = origins[i, 0], origins[i, 1], origins[i, 2]
        rays[4, i], rays[5, i], rays[6, i] = direction[0], direction[1], direction[2]
        rays[8, i] = 1e30
        valid[i] = -1 if traced[i] else 0
    occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)
    return rays[8] < 0


def trace(occluders, origins, direction, traced=None):
    traced = np.ones(PACKET, bool) if traced is None else traced
    address = occluded16_address()
    return blocked(address, occluders.address, origins, np.asarray(direction, np.float32), traced)


@njit
def first_hits(function, scene, origins, direction):
    rays, valid = hit_packet()
    for i in range(PACKET):
        rays[0, i], rays[1, i], rays[2, i] = origins[i, 0], origins[i, 1], origins[i, 2]
        rays[4, i], rays[5, i], rays[6, i] = direction[0], direction[1], direction[2]
        rays[8, i] = 1e30
    valid[:] = -1
    rays[18].view(np.int32)[:] = -1
    intersect16(function, valid.ctypes.data, scene, rays.ctypes.data)
    return rays


def origins_below():
    """Sixteen points on a line below the unit sphere, from its middle outward."""
    origins = np.zeros((PACKET, 3), np.float32)
    origins[:, 0] = np.linspace(0.0, 1.9, PACKET)
    origins[:, 1] = -2.0
    return origins


@pytest.fixture
def ball():
    mesh = sphere((0.0, 0.0, 0.0), 1.0, Material(), 96)
    with Occluders(mesh.positions, mesh.faces) as occluders:
        yield occluders


def test_rays_hit_a_sphere_where_they_pass_within_its_radius(ball):
    origins = origins_below()
    np.testing.assert_array_equal(trace(ball, origins, (0, 1, 0)), origins[:, 0] < 1)
    assert not trace(ball, origins, (0, -1, 0)).any()


def test_a_ray_that_is_not_asked_for_is_not_traced(ball):
    traced = np.arange(PACKET) % 2 == 0
    hit = trace(ball, origins_below(), (0, 1, 0), traced)
    np.testing.assert_array_equal(hit, traced & (origins_below()[:, 0] < 1))


def test_the_nearest_hit_lies_where_distance_and_corners_say():
    mesh = sphere((0.0, 0.0, 0.0), 1.0, Material(), 96)
    origins, up = origins_below(), np.array([0, 2, 0], np.float32)
    with Occluders(mesh.positions, mesh.faces) as occluders:
        rays = first_hits(intersect16_address(), occluders.address, origins, up)
    hit = rays[18].view(np.int32) != -1
    np.testing.assert_array_equal(hit, origins[:, 0] < 1)
    along = origins[hit] + rays[8, hit, None] * up
    u, v = rays[15, hit], rays[16, hit]
    corners = mesh.positions[mesh.faces[rays[17, hit].view(np.int32)]]
    shares = np.stack([1 - u - v, u, v], axis=-1)
    np.testing.assert_allclose(np.einsum("ij,ijk->ik", shares, corners), along, atol=1e-5)
    # The lower half of the unit sphere, but for what the polyhedron lies inside it.
    np.testing.assert_allclose(along[:, 1], -np.sqrt(1 - origins[hit, 0] ** 2), atol=4e-3)
    outward = rays[12:15, hit] / np.linalg.norm(rays[12:15, hit], axis=0)
    assert np.all(np.abs(np.einsum("ki,ik->i", outward, along)) > 0.999)


def test_nothing_is_hit_without_triangles():
    with Occluders(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)) as nothing:
        assert not trace(nothing, origins_below(), (0, 1, 0)).any()


def test_memory_is_freed_once(ball):
    ball.release()
    ball.release()
    assert ball.address == 0
