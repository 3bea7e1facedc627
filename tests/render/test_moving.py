"""Pictures in which everything moves, against a ray caster and against the other renderers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.moving.renderer import MovingRenderer
from render.moving.shadow_rays import POINTS, _aim
from render.moving.shared_rays import Effort, take_turns
from render.opengl.renderer import Renderer
from render.rays.disc_net import disc_net
from render.rays.embree import packet
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.boxes import box
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.light_sets import one_light, only_fill, random_lights, uniform_fill

MATT = Material((0.6, 0.5, 0.4), specular=0.0)
BALL = SphereScene((0.0, 0.5, 0.0), 0.5, MATT, Ground(0.0, (0.5, 0.5, 0.5), 20))
CAMERA = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (64, 64))
INSIDE = away_from_outlines(BALL, CAMERA)
EVERY_PIXEL = Effort(key_lights=64, key_share=0.0, key_rays=16, is_sparing=False, soft_rad=math.inf)


def meshed(scene: SphereScene) -> Scene:
    return Scene((sphere(scene.centre, scene.radius_m, scene.material, 64),), scene.ground)


@pytest.fixture(scope="module")
def ball():
    with MovingRenderer(meshed(BALL), CAMERA) as renderer:
        yield renderer


def relative_rmse(picture, truth, inside):
    off = (picture - truth)[inside, :3]
    return math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2))


def errors(picture, lights, scene=BALL):
    """Relative RMSE of the picture, and relative error of its mean."""
    per_light = 1 if not lights.angular_radius_rad.any() else 1024 // max(len(lights), 1)
    truth = trace(scene, CAMERA, as_points(lights, min(per_light, 256), per_fill=1024))
    mean_error = abs(picture[INSIDE, :3].mean() / truth[INSIDE, :3].mean() - 1)
    return relative_rmse(picture, truth, INSIDE), mean_error


@pytest.mark.parametrize(("radius_deg", "bound"), [(0, 3e-4), (0.5, 0.03), (2, 0.06), (20, 0.06)])
def test_a_shadow_is_as_soft_as_its_light(ball, radius_deg, bound):
    light = one_light((0.6, 1.0, -0.3), angular_radius_rad=math.radians(radius_deg))
    rmse, mean_error = errors(ball.render(light), light)
    assert rmse < bound
    assert mean_error < 0.02


def many_discs(radius_deg, count=64):
    points = random_lights(count, seed=3, lowest=0.3)
    return LightSet(points.directions, points.irradiance, np.full(count, math.radians(radius_deg)))


@pytest.mark.parametrize("radius_deg", [0, 10])
def test_64_interleaved_lights(ball, radius_deg):
    lights = many_discs(radius_deg)
    rmse, mean_error = errors(ball.render(lights), lights)
    assert rmse < 0.02
    assert mean_error < 0.003


def test_rays_from_every_pixel_to_every_point_light_are_exact():
    lights = random_lights(20, seed=5)
    with MovingRenderer(meshed(BALL), CAMERA, effort=Effort(interleaving=1)) as renderer:
        rmse, _ = errors(renderer.render(lights), lights)
    assert rmse < 0.002


def test_a_fill(ball):
    rmse, mean_error = errors(ball.render(only_fill(uniform_fill(1))), only_fill(uniform_fill(1)))
    assert rmse < 0.03
    assert mean_error < 0.004


@pytest.mark.parametrize(
    "material",
    [Material((0.8, 0.6, 0.5), roughness=0.5, metalness=1.0), Material((0.5, 0.3, 0.2), 0.5)],
)
def test_gloss(material):
    scene = replace(BALL, material=material)
    lights = random_lights(12, seed=3, lowest=0.3)
    with MovingRenderer(meshed(scene), CAMERA, effort=EVERY_PIXEL) as renderer:
        rmse, mean_error = errors(renderer.render(lights), lights, scene)
    assert rmse < 0.015
    assert mean_error < 0.002


def test_moving_objects_and_camera_draws_what_a_new_renderer_would():
    lights = many_discs(5, count=8)
    other = Scene((sphere((0.3, 0.6, 0.1), 0.4, MATT, 32), box((-1, 0, -1), (-0.5, 1, 0))))
    camera = replace(CAMERA, eye=np.array([1.0, 1.5, 2.5]), size_px=(48, 40))
    with MovingRenderer(meshed(BALL), CAMERA) as moved, MovingRenderer(other, camera) as new:
        moved.render(lights)
        moved.move(other, camera)
        np.testing.assert_allclose(moved.render(lights), new.render(lights), atol=1e-6)


def test_a_picture_depends_on_its_own_lights_alone(ball):
    """Nothing flickers: the same lights give the same bits, whatever was drawn before."""
    lights = many_discs(10)
    before = ball.render(lights)
    ball.render(many_discs(0, count=5))
    np.testing.assert_array_equal(ball.render(lights), before)


@pytest.mark.parametrize(
    ("count", "keys", "side"), [(64, 0, 4), (65, 3, 4), (9, 2, 4), (7, 2, 2), (3, 3, 4)]
)
def test_every_light_has_one_turn_and_no_turn_is_empty(count, keys, side):
    per_turn, chosen = take_turns(count, keys, side)
    assert len(chosen) == keys + per_turn * min(side**2, count - keys)
    assert sorted(chosen[chosen >= 0]) == list(range(count))
    assert list(chosen[:keys]) == list(range(keys))


def test_no_light_is_lost_at_edges():
    """Where neighbours are of other surfaces, a pixel still has the light it should have.

    A comb of plates a pixel or two wide, in an open sky: none is in another's shadow from above.
    """
    plates = tuple(box((x, 0.0, -1.0), (x + 0.02, 0.02, 1.0), MATT) for x in np.arange(-1, 1, 0.06))
    camera = Camera(np.array([0.0, 3.0, 0.5]), np.array([0.0, 0.0, 0.0]), 0.7, (64, 64))
    lights = random_lights(40, seed=2, lowest=0.9)
    scene = Scene(plates, ground=None)
    with (
        MovingRenderer(scene, camera) as renderer,
        MovingRenderer(scene, camera, effort=Effort(interleaving=1)) as exact,
    ):
        picture, truth = renderer.render(lights), exact.render(lights)
    covered = truth[..., 3] > 0
    np.testing.assert_allclose(picture[covered, :3].mean(), truth[covered, :3].mean(), rtol=0.005)
    assert relative_rmse(picture, truth, covered) < 0.05


@pytest.mark.gl
def test_the_other_renderers_draw_the_same(ctx):
    """Textures, glossy materials, objects in each other's shadow, a background."""
    rng = np.random.default_rng(1)
    scene, camera = default_scene((64, 48))
    texture = np.repeat(np.repeat(rng.integers(0, 255, (4, 4, 3), np.uint8), 8, 0), 8, 1)
    textured = Material((1, 1, 1), 0.6, base_colour_texture=texture)
    first = scene.meshes[0]
    around = np.arctan2(first.normals[:, 0], first.normals[:, 2]) / np.pi
    uv = np.stack([around, first.normals[:, 1]], axis=-1)
    ball, metal, ring = scene.meshes
    rough = replace(metal, material=replace(metal.material, roughness=0.5))  # mirrors the lights
    ball = replace(ball, material=textured, texture_coordinates=uv)
    scene = replace(scene, meshes=(ball, rough, ring))
    background = EnvironmentMap(
        rng.random((16, 32, 3), np.float32), np.ones((16, 32), bool), np.zeros((16, 32), bool)
    )
    lights = random_lights(6, seed=4)
    effort = Effort(interleaving=1)
    with (
        Renderer(ctx, scene, camera, interleaving=1) as drawn,
        MovingRenderer(scene, camera, effort=effort) as renderer,
    ):
        expected, picture = drawn.render(lights, background), renderer.render(lights, background)
    np.testing.assert_array_equal(picture[..., 3], expected[..., 3])
    unseen = expected[..., 3] == 0
    np.testing.assert_allclose(picture[unseen], expected[unseen], atol=2.5 / 256)
    differs = np.abs(picture - expected)[..., :3].max(axis=-1) > 0.03 * expected[..., :3].mean()
    assert differs[~unseen].mean() < 0.06  # at edges of shadows and of texels


def test_objects_in_each_others_shadow():
    """64 wide lights, three objects in each other's shadow, against rays from every pixel."""
    scene, camera = default_scene((160, 120))
    lights = many_discs(10)
    with (
        MovingRenderer(scene, camera) as renderer,
        MovingRenderer(scene, camera, effort=EVERY_PIXEL) as every,
    ):
        picture, truth = renderer.render(lights), every.render(lights)
    assert relative_rmse(picture, truth, truth[..., 3] > 0) < 0.05


def test_nothing_is_drawn_without_light_or_triangles():
    dark = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    with MovingRenderer(Scene((), Ground()), CAMERA) as renderer:
        picture = renderer.render(dark)
        assert np.all(picture[picture[..., 3] == 1, :3] == 0)
        lit = renderer.render(one_light((0, 1, 0)))
    np.testing.assert_allclose(lit[lit[..., 3] == 1, :3], 0.5 / np.pi, rtol=1e-5)


def test_no_light_leaks_in_from_a_neighbour_of_another_surface():
    """The foot of a box on its shaded side: ground in shadow beside a face that looks away."""
    z = np.linspace(-0.2, 0.2, 40)
    directions = np.stack([np.full(40, -1.0), np.ones(40), z], axis=-1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lights = LightSet(directions, np.ones((40, 3)), np.zeros(40))
    scene = Scene((box((-0.5, 0, -2), (0, 0.5, 2)),))
    camera = Camera(np.array([2.0, 1.0, 0.0]), np.array([0.03, 0.03, 0.0]), 0.05, (64, 64))
    with MovingRenderer(scene, camera) as renderer:
        picture = renderer.render(lights)
    assert np.all(picture[..., 3] == 1)
    assert np.all(picture[..., :3] == 0)


def test_a_pixel_whose_neighbours_know_too_little_asks_for_itself():
    """Plates a pixel wide at many heights, half of all lights behind a wall."""
    x = np.arange(-1, 1, 0.08)
    plates = tuple(
        box((at, high, -1.0), (at + 0.03, high + 0.02, 1.0), MATT)
        for at, high in zip(x, 0.35 * (7 * np.arange(len(x)) % 5), strict=True)
    )
    wall = box((2.0, -1.0, -9.0), (2.1, 30.0, 9.0), MATT)
    camera = Camera(np.array([0.0, 8.0, 0.5]), np.array([0.0, 0.0, 0.0]), 0.25, (64, 64))
    lights = random_lights(60, seed=2, lowest=0.5)
    scene = Scene((*plates, wall), ground=None)
    with (
        MovingRenderer(scene, camera) as renderer,
        MovingRenderer(scene, camera, effort=Effort(interleaving=1)) as exact,
    ):
        picture, truth = renderer.render(lights), exact.render(lights)
    error = relative_rmse(picture, truth, truth[..., 3] > 0)
    assert error < 0.1


@pytest.mark.parametrize("ray_count", [1, 4])
def test_rays_of_a_pixel_are_spread_over_the_disc_and_those_of_sixteen_are_all(ray_count):
    points = np.zeros((1, POINTS * ray_count, 3), np.float32)
    points[0, :, 0] = np.arange(POINTS * ray_count)
    sent = np.zeros((ray_count, POINTS))
    for ray in range(ray_count):
        rays, _ = packet()
        _aim(points, 0, ray, ray_count, 0, 0, 1, rays)
        sent[ray] = rays[4]
    # Few in a row are spread (disc_net); few that lie apart by a power of 2 are not.
    assert np.all(sent // ray_count == sent[0] // ray_count)
    assert sorted(sent.ravel()) == list(range(POINTS * ray_count))


def test_first_rays_of_sixteen_pixels_are_spread_over_a_disc():
    """As the others are left out where these agree, they must meet all parts of its penumbra."""
    points = disc_net(np.array([[0.0, 1.0, 0.0]]), np.array([0.01]), 4 * POINTS)
    rays, _ = packet()
    _aim(points.astype(np.float32), 0, 0, 4, 0, 0, 1, rays)
    x, z = rays[4] / 0.01, rays[6] / 0.01
    assert np.hypot(x.mean(), z.mean()) < 0.05
    angle = np.arctan2(z, x)
    assert np.bincount(((angle + np.pi) / (0.5 * np.pi)).astype(int) % 4, minlength=4).min() == 4


@pytest.mark.parametrize("turn_deg", [0, 90, 180, 270])
def test_the_penumbra_of_a_narrow_light_is_whole(turn_deg):
    """From above: the shadow of a slab's edge 5 m up is 22 pixels wide, from whichever side."""
    turn = math.radians(turn_deg)
    x, z = round(3 * math.cos(turn)), round(3 * math.sin(turn))
    scene = Scene((box((x - 3, 5, z - 3), (x + 3, 5.1, z + 3)),), Ground(0.0, (1, 1, 1), 20))
    toward_z = np.array([0.0, 0.0, 1.0])
    camera = Camera(np.array([0.0, 4.0, 0.0]), np.zeros(3), 0.2, (64, 64), up=toward_z)
    light = one_light((0, 1, 0), angular_radius_rad=0.029)
    with MovingRenderer(scene, camera) as renderer:
        picture = renderer.render(light)
    with MovingRenderer(scene, camera, effort=EVERY_PIXEL) as exact:
        truth = exact.render(light)
    assert relative_rmse(picture, truth, truth[..., 3] > 0) < 0.15


def test_pixels_whose_tile_and_neighbours_sent_no_rays_ask_for_themselves():
    """Every second tile sends rays to wide lights; tiny cubes may lie in none of these."""
    place = np.arange(144)
    cubes = tuple(
        box(corner, tuple(np.add(corner, 0.06)), MATT)
        for corner in zip(
            0.15 * (place % 12) - 0.9, place * 7 % 5 * 0.5, 0.15 * (place // 12) - 0.9, strict=True
        )
    )
    camera = Camera(np.array([0.0, 8.0, 0.5]), np.array([0.0, 0.0, 0.0]), 0.25, (64, 64))
    lights = many_discs(5)
    scene = Scene(cubes, ground=None)
    with (
        MovingRenderer(scene, camera) as renderer,
        MovingRenderer(scene, camera, effort=EVERY_PIXEL) as exact,
    ):
        picture, truth = renderer.render(lights), exact.render(lights)
    assert relative_rmse(picture, truth, truth[..., 3] > 0) < 0.08


def test_a_tile_that_agrees_on_a_narrow_key_light_is_as_if_it_had_sent_all_rays(ball):
    """Against 16 rays from every pixel, whatever its neighbours say."""
    narrow = one_light((0.6, 1.0, -0.3), angular_radius_rad=0.02)
    with MovingRenderer(meshed(BALL), CAMERA, effort=EVERY_PIXEL) as exact:
        truth = exact.render(narrow)
    picture = ball.render(narrow)
    hit = truth[..., 3] > 0
    assert relative_rmse(picture, truth, hit) < 0.03
    np.testing.assert_allclose(picture[hit, 0].mean(), truth[hit, 0].mean(), rtol=2e-3)
