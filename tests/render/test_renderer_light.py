"""How much light a picture holds: closed forms of lights, discs and fills, and white furnaces."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from lighting.light_set import LightSet
from lighting.sphere import caps
from render.lights.dome import CELLS
from render.lights.reaching_lights import reaching_lights
from render.opengl.renderer import Renderer
from render.opengl.shadows import ShadowAtlas
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.drawn_scenes import (
    BALL,
    BALL_CAMERA,
    FROM_ABOVE,
    MATT,
    REFLECTANCE,
    ball_scene,
    picture,
    relative_rmse,
)
from tests.render.light_sets import (
    one_light,
    only_fill,
    random_lights,
    uniform_fill,
    uniform_lights,
)

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("zenith_rad", [0.0, 0.5, 1.2, 1.55])
def test_ground_under_one_light_is_rho_over_pi_times_irradiance_times_cosine(ctx, zenith_rad):
    light = one_light((math.sin(zenith_rad), math.cos(zenith_rad), 0.0), (2.0, 3.0, 5.0))
    result = picture(ctx, Scene((), Ground(0.0, REFLECTANCE)), FROM_ABOVE, light)
    expected = np.array(REFLECTANCE) / math.pi * [2, 3, 5] * math.cos(zenith_rad)
    assert_allclose(result[..., :3], np.broadcast_to(expected, (60, 80, 3)), rtol=2e-6)
    assert_array_equal(result[..., 3], 1)


def test_without_lights_the_scene_is_black_and_there(ctx):
    nothing = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    result = picture(ctx, ball_scene(), BALL_CAMERA, nothing)
    assert_array_equal(result[..., :3], 0)
    assert result[..., 3].max() == 1


def test_lights_at_or_below_the_horizon_reach_a_scene_without_ground_only(ctx):
    for direction in ((0.6, -0.8, 0.0), (1.0, 0.0, 0.0)):
        light = one_light(direction)
        assert_array_equal(picture(ctx, ball_scene(), BALL_CAMERA, light)[..., :3], 0)
        floating = ball_scene(replace(BALL, ground=None))
        assert picture(ctx, floating, BALL_CAMERA, light)[..., :3].max() > 0.01


@pytest.mark.parametrize("elevation_rad", [1.2, 0.3, 0.1, 0.0, -0.1, -0.28, -0.31])
def test_ground_gets_what_is_above_its_horizon_of_a_disc(ctx, elevation_rad):
    # In units of the disc's ∫L dω, by the exact integral over its outline.
    direction = np.array([math.cos(elevation_rad), math.sin(elevation_rad), 0.0])
    disc = direction[None], np.ones((1, 3)), np.array([0.3])
    up, in_the_open = np.array([[0.0, 1.0, 0.0]]), np.empty((1, 1, 0, 3))
    irradiance = caps.received(up, in_the_open, math.pi / 2, *disc)[0]
    result = picture(ctx, Scene((), Ground(0.0, REFLECTANCE)), FROM_ABOVE, LightSet(*disc))
    expected = np.broadcast_to(np.array(REFLECTANCE) / math.pi * irradiance, (60, 80, 3))
    assert_allclose(result[..., :3], expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("zenith_rad", [0.0, 1.0, 2.2])
def test_a_disc_reaches_round_a_sphere(ctx, zenith_rad):
    floating = replace(BALL, material=MATT, ground=None)
    direction = (math.sin(zenith_rad), math.cos(zenith_rad), -0.2)
    light = one_light(direction, (2.0, 3.0, 5.0), angular_radius_rad=0.4)
    result = picture(ctx, ball_scene(floating), BALL_CAMERA, light)
    truth = trace(floating, BALL_CAMERA, as_points(light))
    inside = away_from_outlines(floating, BALL_CAMERA)
    assert np.abs(result - truth)[inside].max() < 2e-3 * 5
    # As a point it would leave dark what looks away from the disc's centre.
    as_a_point = trace(floating, BALL_CAMERA, one_light(direction, (2.0, 3.0, 5.0)))
    assert np.abs(as_a_point - truth)[inside].max() > 1e-2 * 5


def test_furnace_a_white_matt_sphere_vanishes_in_a_uniform_fill(ctx):
    white = SphereScene((0, 0, 0), 1.0, Material((1, 1, 1), specular=0.0), None)
    camera = Camera(np.array([0.0, 1.0, 4.0]), np.zeros(3), 0.7, (80, 60))
    inside = picture(ctx, ball_scene(white), camera, only_fill(uniform_fill(1.0)))
    inside = inside[inside[..., 3] == 1][:, :3]
    assert abs(inside.mean() - 1) < 0.001
    assert np.abs(inside - 1).max() < 0.01


def test_ground_gets_the_upper_half_of_the_fill(ctx):
    # ∫ (a + b y) y dω over the upper hemisphere is π a + 2π/3 b; Y1 of y is √(3/4π) y.
    fill = uniform_fill(1.0)
    fill[1] = 0.7 * np.array([1.0, 0.5, -1.0]) / math.sqrt(3 / (4 * math.pi))
    result = picture(ctx, Scene((), Ground(0.0, REFLECTANCE)), FROM_ABOVE, only_fill(fill))
    irradiance = math.pi + 2 * math.pi / 3 * 0.7 * np.array([1.0, 0.5, -1.0])
    expected = np.array(REFLECTANCE) / math.pi * irradiance
    assert_allclose(result[..., :3], np.broadcast_to(expected, (60, 80, 3)), atol=5e-3)


def test_a_fill_agrees_with_brute_force(ctx):
    fill = uniform_fill(1.0)
    fill[1:4] = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 3))
    lights = only_fill(fill)
    camera = replace(BALL_CAMERA, size_px=(40, 30))
    inside = away_from_outlines(BALL, camera)
    result = picture(ctx, ball_scene(), camera, lights)[inside]
    truth = trace(BALL, camera, as_points(lights, per_fill=1024))[inside]
    # Most of what is left is the edges of the dome's shadows.
    assert relative_rmse(result[:, :3], truth[:, :3]) < 0.03


def test_the_maps_of_the_fill_are_drawn_once(ctx, monkeypatch):
    drawn = []
    draw = ShadowAtlas.draw

    def counted(atlas, *light):
        drawn.append(draw(atlas, *light))
        return drawn[-1]

    monkeypatch.setattr(ShadowAtlas, "draw", counted)
    with Renderer(ctx, ball_scene(rings=8), BALL_CAMERA) as renderer:
        for count in (2, 70, 2):  # the tiles of lights change their size
            renderer.render(replace(random_lights(count, seed=13), fill=uniform_fill(count)))
    assert drawn == [2, CELLS // 2, 4, 66, 0, 2, 0]


def test_lights_and_fill_add_up(ctx):
    lights, fill = random_lights(3, seed=14), uniform_fill(0.3)
    with Renderer(ctx, ball_scene(), BALL_CAMERA) as renderer:
        both = renderer.render(replace(lights, fill=fill))
        parts = renderer.render(lights) + renderer.render(only_fill(fill))
    assert_allclose(both[..., :3], parts[..., :3], rtol=1e-5, atol=1e-6)


def test_lights_without_power_are_left_out():
    lights = LightSet(np.tile([0.0, 1.0, 0.0], (2, 1)), np.array([[0, 0, 0], [0, 1, 0]]), [0, 0])
    directions, irradiance, radius_rad = reaching_lights(lights, Scene((), Ground()))
    assert len(directions) == len(radius_rad) == 1
    assert_array_equal(irradiance, [[0, 1, 0]])


def test_furnace_a_white_matt_sphere_vanishes_in_uniform_light(ctx):
    # Outgoing radiance is ρ/π ∫ L cos dω = ρ L. 1024 lights sum the cosine to 0.3 %; where the
    # terminator of a light crosses, its shadow map adds as much.
    white = SphereScene((0, 0, 0), 1.0, Material((1, 1, 1), specular=0.0), None)
    camera = Camera(np.array([0.0, 1.0, 4.0]), np.zeros(3), 0.7, (80, 60))
    result = picture(ctx, ball_scene(white, rings=32), camera, uniform_lights(1024))
    inside = result[result[..., 3] == 1][:, :3]
    assert len(inside) > 1000
    assert abs(inside.mean() - 1) < 0.002
    assert np.abs(inside - 1).max() < 0.01
