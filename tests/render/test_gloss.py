"""Reflections of the map: energy, direction, width, the ground, and what stops them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import grid_to_direction
from render.baked.renderer import BakedRenderer
from render.lights.light_map import map_of_lights
from render.lights.map_pyramid import map_pyramid
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, away_from_outlines
from tests.render.light_sets import random_lights, uniform_fill

CAMERA = Camera(np.array([0.0, 0.5, 3.0]), np.zeros(3), 0.8, (48, 48))
DARK = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
ROWS = 64


def metal(roughness, base=(1.0, 1.0, 1.0)):
    return Material(base, roughness, metalness=1.0)


def ball(material, ground=None):
    return Scene((sphere((0, 0, 0), 1, material, 64),), ground)


def whole(radiance):
    seen = np.ones(radiance.shape[:2], bool)
    return EnvironmentMap(np.ascontiguousarray(radiance, np.float32), seen, ~seen)


def directions(rows=ROWS):
    column, row = np.meshgrid(np.arange(2 * rows), np.arange(rows))
    return grid_to_direction(np.stack([column, row], axis=-1), rows)


def picture(scene, environment, lights=DARK):
    with BakedRenderer(scene, CAMERA) as renderer:
        seen = renderer.render(lights, environment)
    inside = SphereScene((0, 0, 0), 1.0, Material(), None)
    return seen[..., :3], away_from_outlines(inside, CAMERA) & (seen[..., 3] == 1)


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.3])
def test_a_smooth_metal_in_a_white_furnace_is_white(roughness):
    """But for what facets pass on to each other, 2.7 % at the rim for a roughness of 0.3."""
    seen, inside = picture(ball(metal(roughness)), whole(np.ones((ROWS, 2 * ROWS, 3))))
    assert_allclose(seen[inside], 1, atol=0.03)


def test_a_mirror_shows_the_mirrored_direction():
    """Radiance that is linear in direction, so that no mean over a part changes it."""
    linear = 2 + directions()
    seen, inside = picture(ball(metal(0.0)), whole(linear))
    rows, columns = np.nonzero(inside)
    across, up = CAMERA.half_extent()
    x, y = (2 * columns + 1) / 48 - 1, 1 - (2 * rows + 1) / 48
    rays = np.stack([across * x, up * y, -np.ones(len(x))], axis=-1) @ CAMERA.axes()
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    along = -rays @ CAMERA.eye
    normal = CAMERA.eye + (along - np.sqrt(along**2 - CAMERA.eye @ CAMERA.eye + 1))[:, None] * rays
    mirrored = rays - 2 * (rays * normal).sum(axis=1, keepdims=True) * normal
    assert_allclose(seen[inside], 2 + mirrored, atol=0.03)


def test_the_poles_and_the_seam_are_ordinary_places():
    """The same spot is mirrored wherever the map is turned; on a pole 10 % wider."""
    reflected, peak = np.zeros(3), np.zeros(3)
    camera_at = ((0.0, 0.0, 3.0), (0.0, 3.0, 0.0), (0.0, 0.0, -3.0))  # images: +Z, +Y, −Z
    for row, eye in enumerate(np.array(camera_at)):
        up = np.array([1.0, 0.0, 0.0])
        camera = replace(CAMERA, eye=eye, up=up, size_px=(33, 33))
        spot = (directions() @ (eye / 3) > np.cos(np.radians(7))) * 1.0
        spot *= 0.05 / whole(np.repeat(spot[..., None], 3, 2)).integral()[0]
        with BakedRenderer(ball(metal(0.25)), camera) as renderer:
            seen = renderer.render(DARK, whole(np.repeat(spot[..., None], 3, 2)))
        reflected[row], peak[row] = seen[..., 0].mean(), seen[11:22, 11:22, 0].mean()
    assert_allclose(reflected, reflected[0], rtol=0.04)
    assert_allclose(peak, peak[0], rtol=0.1)


@pytest.mark.parametrize("roughness", [0.1, 0.35])
def test_below_the_horizon_a_ball_mirrors_the_ground_as_if_nothing_stood_on_it(roughness):
    ground = Ground(-1.0, (0.4, 0.3, 0.2), 1000)
    upward = LightSet(np.array([[0.0, 1.0, 0.0]]), np.full((1, 3), np.pi), np.full(1, 0.3))
    dark = whole(np.zeros((ROWS, 2 * ROWS, 3)))
    seen, _ = picture(ball(metal(roughness), ground), dark, upward)
    assert_allclose(seen[36, 24], ground.reflectance, rtol=0.05)  # below the middle of the ball


@pytest.mark.parametrize("roughness", [0.1, 0.35])
def test_through_the_ground_a_ball_mirrors_the_floor_of_the_map(roughness):
    floor = np.where(directions()[..., 1:2] < 0, [0.4, 0.3, 0.2], 0.0)
    with BakedRenderer(ball(metal(roughness), Ground(-1.0)), CAMERA) as renderer:
        seen = renderer.render(DARK, whole(floor), through_ground=True)
    assert_allclose(seen[36, 24, :3], [0.4, 0.3, 0.2], rtol=0.06)


def test_a_ball_does_not_show_the_map_through_another():
    blocked = Scene((*ball(metal(0.1)).meshes, sphere((0, 0, 40.0), 36.0, metal(0.1), 96)), None)
    environment = whole(np.ones((ROWS, 2 * ROWS, 3)))
    with BakedRenderer(blocked, CAMERA) as renderer:
        seen = renderer.render(DARK, environment)
    assert_allclose(seen[24, 24, :3], 0, atol=1e-6)  # mirrors what stands behind the camera


@pytest.mark.parametrize("roughness", [0.25, 0.5])
def test_a_key_light_is_mirrored_once(roughness):
    """With the light that the map's spot is, or without, the ball reflects the same in all."""
    toward = np.array([0.3, 0.6, 1.0]) / np.linalg.norm([0.3, 0.6, 1.0])
    spot = directions() @ toward > np.cos(np.radians(4))
    environment = whole(np.where(spot[..., None], 100.0, 0.5) * np.ones(3))
    irradiance = 99.5 * 2 * np.pi * (1 - np.cos(np.radians(4)))
    key = LightSet(toward[None], np.full((1, 3), irradiance), np.array([np.radians(2.4)]))
    with_key, inside = picture(ball(metal(roughness)), environment, key)
    without, _ = picture(ball(metal(roughness)), environment)
    assert_allclose(with_key[inside].mean(), without[inside].mean(), rtol=0.03)
    assert with_key[inside].max() > 2


def test_halving_a_map_keeps_its_light():
    rng = np.random.default_rng(2)
    environment = whole(rng.random((48, 96, 3), np.float32))
    pyramid = map_pyramid(environment)
    for rows in (32, 16, 8, 4):
        coarse = pyramid.coarse(rows)
        assert coarse.shape == (rows, 2 * rows, 3)
        assert_allclose(whole(coarse).integral(), environment.integral(), rtol=2e-3)


def test_lights_as_a_map_keep_their_light():
    lights = random_lights(20, seed=1)
    lights = replace(lights, fill=uniform_fill(0.3))
    shown = map_of_lights(lights, 32)
    assert_allclose(shown.integral(), lights.irradiance.sum(axis=0) + 4 * np.pi * 0.3, rtol=1e-4)
