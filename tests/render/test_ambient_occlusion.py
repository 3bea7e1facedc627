"""Ambient occlusion against closed forms."""

import math

import numpy as np
import pytest

from capture.errors import InputError
from render.rays.background import picture_rays
from render.reference.ambient_occlusion import ambient_occlusion, vertex_occlusion
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene

RADIUS_M, HEIGHT_M = 0.5, 2.0
BALL, COARSE = (sphere((0.0, HEIGHT_M, 0.0), RADIUS_M, Material(), rings) for rings in (96, 24))
OVER_GROUND = Scene((BALL,), Ground(0.0, radius_m=1e4))
TO_GROUND = Camera(np.array([0.0, 2.0, 5.0]), np.array([0.0, 0.0, 0.5]), 0.4, (24, 24))


def ground_points(camera):
    rays = picture_rays(camera, camera.size_px)
    return camera.eye + rays * (-camera.eye[1] / rays[..., 1:2])


def test_the_ground_under_a_ball():
    """A ball wholly above the horizon takes cos θ (r / D)² of the sky."""
    to_ball = [0, HEIGHT_M, 0] - ground_points(TO_GROUND)
    distance = np.linalg.norm(to_ball, axis=-1)
    expected = 1 - to_ball[..., 1] / distance * (RADIUS_M / distance) ** 2
    seen = ambient_occlusion(OVER_GROUND, TO_GROUND)
    assert expected.min() < 0.945
    np.testing.assert_allclose(seen[..., 0], expected, atol=0.03)
    assert abs(np.mean(seen[..., 0] - expected)) < 0.002
    np.testing.assert_array_equal(seen[..., 1], 1)


@pytest.mark.parametrize("cone_deg", [60, 90, 180])
def test_a_cone(cone_deg):
    """Straight below the ball it takes sin² of its radius over sin² of the cone's."""
    camera = Camera(np.array([0.0, 0.1, 1.0]), np.zeros(3), 0.002, (4, 4))
    seen = ambient_occlusion(OVER_GROUND, camera, math.radians(cone_deg))
    share = (RADIUS_M / HEIGHT_M) ** 2 / math.sin(math.radians(cone_deg / 2)) ** 2
    np.testing.assert_allclose(seen[..., 0].mean(), 1 - share, atol=0.02)


@pytest.mark.parametrize(("distance_m", "is_open"), [(1.4, True), (3.0, False)])
def test_what_is_far_does_not_count(distance_m, is_open):
    camera = Camera(np.array([0.0, 0.1, 1.0]), np.zeros(3), 0.002, (4, 4))
    seen = ambient_occlusion(OVER_GROUND, camera, distance_m=distance_m)
    assert (seen[..., 0].min() == pytest.approx(1)) == is_open


@pytest.mark.parametrize(("distance_m", "expected"), [(math.inf, 0.5), (1.4, 1.0)])
def test_the_ground_takes_half_of_the_sky_of_an_upright_face(distance_m, expected):
    camera = Camera(np.array([0.0, HEIGHT_M, 4.0]), np.array([0.0, HEIGHT_M, 0.0]), 0.002, (4, 4))
    seen = ambient_occlusion(OVER_GROUND, camera, distance_m=distance_m)
    np.testing.assert_allclose(seen[..., 0], expected, atol=0.02)


def test_a_ball_in_the_open_is_open_and_beside_it_is_nothing():
    camera = Camera(np.array([0.0, HEIGHT_M, 3.0]), np.array([0.0, HEIGHT_M, 0.0]), 0.6, (21, 17))
    seen = ambient_occlusion(Scene((BALL,), None), camera)
    assert 0.1 < (seen[..., 1] == 1).mean() < 0.9
    np.testing.assert_allclose(seen[seen[..., 1] > 0, 0], 1, atol=0.02)
    np.testing.assert_array_equal(seen[0, 0], 0)
    np.testing.assert_allclose(seen[8, 10], 1)


@pytest.mark.parametrize("cone_deg", [0, -5, 181, math.nan])
def test_a_cone_that_is_none(cone_deg):
    with pytest.raises(InputError, match="cone must be above 0"):
        ambient_occlusion(OVER_GROUND, TO_GROUND, math.radians(cone_deg))


@pytest.mark.parametrize("distance_m", [0, -1, math.nan])
def test_a_distance_that_is_none(distance_m):
    with pytest.raises(InputError, match="distance must be above 0"):
        ambient_occlusion(OVER_GROUND, TO_GROUND, distance_m=distance_m)


def test_vertices_of_a_ball_over_the_ground():
    """What is convex hides nothing of itself, and the ground (1 − n·up)/2 of the sky."""
    (openness,) = vertex_occlusion(Scene((COARSE,), OVER_GROUND.ground))
    expected = (1 + COARSE.normals[:, 1]) / 2
    np.testing.assert_allclose(openness, expected, atol=0.02)
    assert abs(np.mean(openness - expected)) < 0.001


def test_vertices_of_each_mesh_by_themselves():
    """A small mesh far below a ball, and its twin in the open."""
    below, beside = (sphere((x, 0.0, 0.0), 0.01, Material(), 5) for x in (0.0, 20.0))
    of_ball, of_below, of_beside = vertex_occlusion(
        Scene((COARSE, below, beside), None), math.pi / 3
    )
    assert [len(each) for each in (of_ball, of_below, of_beside)] == [
        len(mesh.positions) for mesh in (COARSE, below, beside)
    ]
    top = np.argmax(below.positions[:, 1])
    share = (RADIUS_M / HEIGHT_M) ** 2 / math.sin(math.pi / 6) ** 2
    assert of_below[top] == pytest.approx(1 - share, abs=0.02)
    assert of_beside[top] == 1
    np.testing.assert_array_equal(
        vertex_occlusion(Scene((COARSE, below), None), distance_m=1.4)[1], 1
    )


def test_vertices_of_a_scene_without_meshes():
    assert vertex_occlusion(Scene((), Ground())) == ()
