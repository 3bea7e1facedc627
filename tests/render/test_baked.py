"""Pictures from baked transport against a ray caster, and against the renderer with shadow maps."""

import gc
import math
import weakref
from dataclasses import replace

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.narrow import STANDING
from render.baked.renderer import BakedRenderer
from render.opengl.renderer import Renderer
from render.rays.background import look_up, map_coordinates, picture_rays
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.light_sets import (
    one_light,
    only_fill,
    random_lights,
    scaled,
    uniform_fill,
    uniform_lights,
)

MATT = Material((0.6, 0.5, 0.4), specular=0.0)
BALL = SphereScene((0.0, 0.5, 0.0), 0.5, MATT, Ground(0.0, (0.5, 0.5, 0.5), 20))
BLACK = Ground(0.0, (0.0, 0.0, 0.0), 20)
CAMERA = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (48, 48))
INSIDE = away_from_outlines(BALL, CAMERA)


def meshed(scene: SphereScene) -> Scene:
    return Scene((sphere(scene.centre, scene.radius_m, scene.material, 64),), scene.ground)


@pytest.fixture(scope="module")
def ball():
    with BakedRenderer(meshed(BALL), CAMERA) as renderer:
        yield renderer


def whole_map(radiance):
    return EnvironmentMap(radiance, np.ones((16, 32), bool), np.zeros((16, 32), bool))


def settled(renderer, lights):
    """Return the picture of a light that has stood until it was traced."""
    for _ in range(STANDING):
        picture = renderer.render(lights)
    return picture


def errors(picture, lights, scene=BALL):
    """Relative RMSE of the picture, and relative error of its mean."""
    truth = trace(scene, CAMERA, as_points(lights, per_fill=1024))[INSIDE, :3]
    result = picture[INSIDE, :3]
    rmse = math.sqrt(np.mean((result - truth) ** 2) / np.mean(truth**2))
    return rmse, abs(result.mean() / truth.mean() - 1)


@pytest.mark.parametrize(("radius_deg", "bound"), [(0, 2e-4), (2, 0.01), (5, 0.008), (20, 0.008)])
def test_a_shadow_is_as_soft_as_its_light(ball, radius_deg, bound):
    light = one_light((0.6, 1.0, -0.3), angular_radius_rad=math.radians(radius_deg))
    rmse, mean_error = errors(settled(ball, light), light)
    assert rmse < bound
    assert mean_error < 0.002


def test_a_fill(ball):
    fill = uniform_fill(1.0)
    fill[1:4] = [[0.5, 0.0, -0.5], [0.2, 0.3, 0.0], [0.0, -0.2, 0.4]]
    rmse, mean_error = errors(ball.render(only_fill(fill)), only_fill(fill))
    assert rmse < 0.004
    assert mean_error < 0.002


@pytest.mark.parametrize(
    ("material", "bound"),
    [
        pytest.param(
            Material((0.8, 0.6, 0.5), roughness=0.5, metalness=1.0), 0.03, marks=pytest.mark.slow
        ),
        (Material((0.5, 0.3, 0.2), roughness=0.5), 0.012),
    ],
)
def test_gloss(material, bound):
    scene = replace(BALL, material=material, ground=BLACK)
    points = random_lights(12, seed=3, lowest=0.3)
    lights = LightSet(points.directions, points.irradiance, np.full(12, 0.2))
    with BakedRenderer(meshed(scene), CAMERA) as renderer:
        rmse, mean_error = errors(renderer.render(lights), lights, scene)
    assert rmse < bound
    assert mean_error < 0.02


@pytest.mark.gl
def test_point_lights_as_shadow_maps_draw_them(ctx):
    """Objects in each other's shadow: but for the pixels on shadows' edges the pictures agree."""
    scene, camera = default_scene((64, 48))
    scene = replace(scene, meshes=tuple(replace(mesh, material=MATT) for mesh in scene.meshes))
    lights = random_lights(6, seed=4)
    with (
        Renderer(ctx, scene, camera, interleaving=1) as drawn,
        BakedRenderer(scene, camera) as renderer,
    ):
        expected, picture = drawn.render(lights)[..., :3], renderer.render(lights)[..., :3]
    differs = np.abs(picture - expected).max(axis=-1) > 0.02 * expected.mean()
    assert differs.mean() < 0.02


def test_without_a_ground_light_comes_from_below():
    scene = replace(BALL, ground=None)
    below = one_light((0.2, -1.0, 0.4), angular_radius_rad=0.3)
    camera = replace(CAMERA, eye=np.array([0.5, -1.5, 2.0]))
    with BakedRenderer(meshed(scene), camera) as renderer:
        picture = renderer.render(below)
    truth = trace(scene, camera, as_points(below))
    inside = away_from_outlines(scene, camera) & (truth[..., 3] == 1)
    np.testing.assert_allclose(picture[inside, :3].mean(), truth[inside, :3].mean(), rtol=0.01)


def test_a_white_furnace_stays_white():
    """A ball of reflectance 1 under a radiance of 1 from everywhere has radiance 1."""
    scene = replace(BALL, material=Material((1.0, 1.0, 1.0), specular=0.0), ground=None)
    with BakedRenderer(meshed(scene), CAMERA) as renderer:
        picture = renderer.render(uniform_lights(1500))
    inside = away_from_outlines(scene, CAMERA) & (picture[..., 3] == 1)
    np.testing.assert_allclose(picture[inside, :3], 1, atol=0.01)


def test_pictures_add_and_scale(ball):
    """Up to the steps of the transport, which are the same for every light."""
    first, second = one_light((0.3, 1, 0), angular_radius_rad=0.3), only_fill(uniform_fill(0.5))
    together = replace(first, fill=second.fill)
    total = ball.render(first)[..., :3] + ball.render(second)[..., :3]
    np.testing.assert_allclose(ball.render(together)[..., :3], total, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(
        ball.render(scaled(first, 3))[..., :3], 3 * ball.render(first)[..., :3], rtol=1e-5
    )


def test_a_released_renderer_leaves_no_memory_behind():
    scene, camera = default_scene((32, 24))
    gc.disable()
    try:
        with BakedRenderer(scene, camera) as renderer:
            renderer.render(random_lights(2, seed=1))
            alive = weakref.ref(renderer)
        del renderer
        assert alive() is None  # 100 MB and more, for each view of somebody who walks around
    finally:
        gc.enable()


def test_a_picture_depends_on_its_own_lights_alone(ball):
    """Once they stand, and but for a quarter of a radius that they may have come from."""
    first, second = one_light((0.6, 1.0, -0.3)), one_light((-0.6, 1.0, 0.3))
    before = settled(ball, first)
    settled(ball, second)
    np.testing.assert_array_equal(settled(ball, first), before)


@pytest.mark.parametrize(("radius_deg", "bound"), [(0, 3e-4), (0.5, 0.03), (4, 0.08)])
def test_a_light_that_moves_is_drawn_by_rays(ball, radius_deg, bound):
    settled(ball, one_light((0.6, 1.0, 0.3)))
    light = one_light((0.6, 1.0, -0.3), angular_radius_rad=math.radians(radius_deg))
    rmse, mean_error = errors(ball.render(light), light)
    assert rmse < bound
    assert mean_error < 0.02


def test_a_moving_light_is_mirrored_as_a_standing_one():
    material = Material((0.8, 0.6, 0.5), roughness=0.4, metalness=1.0)
    light = one_light((0.4, 1.0, 0.5), angular_radius_rad=0.02)
    elsewhere = one_light((-0.6, 1.0, 0.3))
    inside = away_from_outlines(replace(BALL, material=material), CAMERA)
    with BakedRenderer(meshed(replace(BALL, material=material)), CAMERA) as renderer:
        standing = renderer.render(light)[inside, :3]
        settled(renderer, elsewhere)
        moving = renderer.render(light)[inside, :3]
    np.testing.assert_allclose(moving.mean(), standing.mean(), rtol=0.02)
    np.testing.assert_allclose(moving.max(), standing.max(), rtol=0.1)


@pytest.mark.gl
def test_coverage_background_and_samples_are_the_renderers(ctx):
    """Where nothing is hit the map shows, bilinear: llvmpipe weighs in steps of 1/256."""
    camera = replace(CAMERA, eye=np.array([1.0, 0.8, 2.5]), size_px=(40, 30))
    environment = whole_map(np.random.default_rng(1).random((16, 32, 3), np.float32))
    lights = one_light((0.6, 1.0, -0.3))
    with (
        Renderer(ctx, meshed(BALL), camera, 2) as drawn,
        BakedRenderer(meshed(BALL), camera, 2) as renderer,
    ):
        expected = drawn.render(lights, environment)
        picture = renderer.render(lights, environment)
    differs = picture[..., 3] != expected[..., 3]  # OpenGL's ground has 256 sides
    assert differs.mean() < 0.01
    unseen = (expected[..., 3] == 0) & ~differs
    assert unseen.any()
    np.testing.assert_allclose(picture[unseen], expected[unseen], atol=2.5 / 256)
    assert picture.flags.c_contiguous
    assert picture.dtype == np.float32


def covered_by_ball(camera):
    """Return the pixels that the ball covers."""
    with BakedRenderer(Scene(meshed(BALL).meshes, None), camera) as renderer:
        alpha = renderer.render(one_light((0, 1, 0)))[..., 3]
    assert 0.05 < alpha.mean() < 0.5
    return alpha > 0


def test_through_the_ground_the_map_shows_in_the_shadows_of_the_objects():
    camera = replace(CAMERA, size_px=(40, 30))
    environment = whole_map(1 + np.random.default_rng(1).random((16, 32, 3), np.float32))
    lights = one_light((0.6, 1.0, -0.3), angular_radius_rad=0.05)
    lights = replace(lights, fill=uniform_fill(0.2))
    with BakedRenderer(meshed(BALL), camera) as renderer:
        grey = renderer.render(lights, environment)
        mixed = renderer.render(lights, environment, through_ground=True)
    with BakedRenderer(Scene((), BALL.ground), camera) as renderer:
        without = renderer.render(lights, environment)
        floor = renderer.render(lights, environment, through_ground=True)
    ball = covered_by_ball(camera)
    # What faces the floor is brighter by its light.
    more = (mixed - grey)[ball, :3].mean(axis=-1)
    assert more.min() >= 0
    upper, lower = more[: len(more) // 3], more[-len(more) // 3 :]
    assert upper.mean() < 0.25 * lower.mean()
    # Nothing on it: the floor is the map. Else it is darker by as much as the grey ground is.
    expected = np.zeros((30 * 40, 4), np.float32)
    at = map_coordinates(picture_rays(camera, (40, 30)).reshape(-1, 3))
    look_up(environment.radiance, at, np.arange(30 * 40), expected)
    np.testing.assert_allclose(floor[..., :3], expected.reshape(30, 40, 4)[..., :3], rtol=0.01)
    shade = grey[~ball, :3] / without[~ball, :3]
    assert shade.min() < 0.5
    np.testing.assert_allclose(mixed[~ball, :3], shade * floor[~ball, :3], rtol=0.02)


def test_where_no_floor_was_seen_the_ground_stays_grey():
    camera = replace(CAMERA, size_px=(40, 30))
    environment = whole_map(np.random.default_rng(1).random((16, 32, 3), np.float32))
    seen = environment.valid.copy()
    seen[8:] = False
    environment = replace(environment, valid=seen)
    lights = one_light((0.6, 1.0, -0.3), angular_radius_rad=0.05)
    with BakedRenderer(meshed(BALL), camera) as renderer:
        grey = renderer.render(lights, environment)
        mixed = renderer.render(lights, environment, through_ground=True)
    ball = covered_by_ball(camera)
    np.testing.assert_allclose(mixed[~ball], grey[~ball], rtol=0.02, atol=1e-3)
