"""Light at points all over a scene, and pictures of it from a camera that moves."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked import surface_points as points_module
from render.baked.between_points import add_irradiance
from render.baked.renderer import BakedRenderer
from render.baked.roaming import RoamingRenderer
from render.baked.surface_points import surface_points
from render.moving.renderer import MovingRenderer
from render.moving.shared_rays import Effort
from render.rays.surface_rows import (
    FIELDS,
    KIND,
    MATT,
    NOTHING,
    POSITION,
    empty_surfaces,
    in_picture,
)
from render.rays.traced_scene import TracedScene
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.boxes import box
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.light_sets import one_light, only_fill, random_lights, uniform_fill

MATT_GREY = Material((0.6, 0.5, 0.4), specular=0.0)
BALL = SphereScene((0.0, 0.5, 0.0), 0.5, MATT_GREY, Ground(0.0, (0.5, 0.5, 0.5), 20))
CAMERA = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (48, 48))
SCENE = Scene((sphere(BALL.centre, BALL.radius_m, MATT_GREY, 48),), BALL.ground)


def found(scene, camera):
    """Return points, surfaces in memory and as a picture."""
    traced = TracedScene(scene)
    surfaces = empty_surfaces(camera.size_px, FIELDS + 3)
    traced.find_surfaces(camera, camera.size_px, surfaces)
    points = surface_points(traced.geometry, scene.ground)
    traced.release()
    return points, surfaces, in_picture(surfaces, camera.size_px)


def interpolated(points, surfaces, size_px, irradiance, unshaded=(0, 0, 0)):
    picture = np.zeros((*size_px[::-1], 4), np.float32)
    add_irradiance(
        surfaces, points.corners, points.steps, points.grids, points.ground_start,
        irradiance.astype(np.float32), np.array(unshaded, np.float32), picture,
    )  # fmt: skip
    return picture[..., :3]


def test_between_points_light_that_is_linear_stays_so():
    """On triangles that are cut, on those that are not, and on all grids of the ground."""
    tall = box((-0.9, 0.0, -0.9), (-0.3, 1.0, -0.2), MATT_GREY)
    scene = Scene((*SCENE.meshes, tall), BALL.ground)
    camera = replace(CAMERA, eye=np.array([1.5, 3.0, 2.0]))
    points, surfaces, seen = found(scene, camera)
    assert points.steps.min() == 1
    assert points.steps.max() > 8
    slope = np.array([[0.1, 0.2, -0.1], [-0.3, 0.1, 0.0], [0.2, 0.1, 0.4]])
    picture = interpolated(points, surfaces, camera.size_px, points.positions @ slope + 3)
    hit = seen[..., KIND] != NOTHING
    matt = seen[..., MATT : MATT + 3]
    expected = matt * (seen[..., POSITION : POSITION + 3] @ slope + 3)
    np.testing.assert_allclose(picture[hit], expected[hit], rtol=1e-4, atol=1e-4)
    # And of no other points than those around, or it would overshoot.
    noise = np.random.default_rng(1).integers(0, 2, points.positions.shape)
    share = interpolated(points, surfaces, camera.size_px, noise)[hit] / matt[hit]
    assert -1e-4 < share.min() < 0.01
    assert 0.99 < share.max() < 1 + 1e-4


def test_beyond_the_grids_nothing_is_shaded():
    camera = Camera(np.array([15.0, 1.0, 0.0]), np.array([18.0, 0.0, 0.0]), 0.3, (16, 16))
    points, surfaces, seen = found(SCENE, camera)
    dark = np.zeros_like(points.positions)
    picture = interpolated(points, surfaces, camera.size_px, dark, (1.0, 2.0, 3.0))
    hit = seen[..., KIND] != NOTHING
    assert hit.any()
    np.testing.assert_allclose(picture[hit], 0.5 / np.pi * np.tile([1, 2, 3], (hit.sum(), 1)))


@pytest.fixture(scope="module", autouse=True)
def _few_points():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(points_module, "_GRID_STEPS", 40)
        yield


@pytest.fixture(scope="module")
def ball():
    with RoamingRenderer(SCENE) as renderer:
        yield renderer


def errors(picture, lights, camera):
    truth = trace(BALL, camera, as_points(lights, 64, per_fill=1024))
    inside = away_from_outlines(BALL, camera)
    off = (picture - truth)[inside, :3]
    mean = picture[inside, :3].mean() / truth[inside, :3].mean()
    return math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2)), abs(mean - 1)


@pytest.mark.parametrize("eye", [(0.5, 3.0, 2.0), (-2.0, 0.8, 1.0)])
def test_a_fill_and_wide_lights(ball, eye):
    points = random_lights(8, seed=2, lowest=0.3)
    lights = LightSet(points.directions, points.irradiance, np.full(8, 0.2))
    lights = replace(lights, fill=uniform_fill(0.3))
    camera = replace(CAMERA, eye=np.array(eye))
    rmse, mean_error = errors(ball.render(camera, lights), lights, camera)
    assert rmse < 0.02
    assert mean_error < 0.008


def test_a_point_light_is_sharp(ball):
    light = one_light((0.6, 1.0, -0.3))
    rmse, _ = errors(ball.render(CAMERA, light), light, CAMERA)
    assert rmse < 3e-4


def test_other_light_is_shown_at_once(ball):
    first, second = only_fill(uniform_fill(1.0)), only_fill(uniform_fill(2.0))
    before = ball.render(CAMERA, first)
    np.testing.assert_allclose(ball.render(CAMERA, second)[..., :3], 2 * before[..., :3], rtol=1e-5)
    np.testing.assert_array_equal(ball.render(CAMERA, first), before)


def test_map_and_mirrors_are_those_of_baked_pictures():
    """A metal ball under a smooth map, which shows behind it and through the ground."""
    metal = Material((0.9, 0.8, 0.7), roughness=0.3, metalness=1.0)
    scene = Scene((sphere(BALL.centre, BALL.radius_m, metal, 32),), BALL.ground)
    camera = replace(CAMERA, eye=np.array([0.5, 0.9, 2.5]))
    column = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    radiance = np.tile(1 + 0.5 * np.sin(column)[None, :, None], (32, 1, 3)).astype(np.float32)
    seen = np.ones((32, 64), bool)
    environment = EnvironmentMap(radiance, seen, ~seen)
    lights = replace(one_light((0.4, 1.0, 0.3), angular_radius_rad=0.1), fill=uniform_fill(0.5))
    with (
        BakedRenderer(scene, camera) as baked,
        RoamingRenderer(scene) as roaming,
        MovingRenderer(scene, camera, effort=Effort(interleaving=1)) as moving,
    ):
        for through_ground in (False, True):
            expected = baked.render(lights, environment, through_ground=through_ground)
            for picture in (
                roaming.render(camera, lights, environment, through_ground=through_ground),
                moving.render(lights, environment, through_ground=through_ground),
            ):
                np.testing.assert_array_equal(picture[..., 3], expected[..., 3])
                off = (picture - expected)[..., :3]
                assert math.sqrt(np.mean(off**2) / np.mean(expected[..., :3] ** 2)) < 0.05
