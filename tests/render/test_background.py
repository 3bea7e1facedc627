"""The environment behind a scene against what OpenGL draws."""

import math

import numpy as np
import pytest

from lighting.maps.environment import EnvironmentMap
from render.opengl.renderer import Renderer
from render.rays.background import look_up, map_coordinates, picture_rays
from render.scenes.scene import Camera, Ground, Scene
from tests.render.light_sets import only_fill

VIEWS = {
    "level": Camera(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.2, (40, 30)),
    "seam": Camera(np.zeros(3), np.array([0.1, 0.1, -1.0]), 1.2, (40, 30)),
    "pole": Camera(np.zeros(3), np.array([0.0, 1.0, 1e-3]), 2.0, (31, 33)),
}


def whole_map(radiance):
    return EnvironmentMap(radiance, np.ones((16, 32), bool), np.zeros((16, 32), bool))


def looked_up(camera, radiance):
    width, height = camera.size_px
    rays = picture_rays(camera, (width, height)).reshape(-1, 3)
    out = np.zeros((width * height, 4), np.float32)
    look_up(radiance, map_coordinates(rays), np.arange(width * height), out)
    return out.reshape(height, width, 4)


def test_the_middle_of_a_picture_looks_at_the_target():
    camera = Camera(np.array([1.0, 2.0, 3.0]), np.array([4.0, 1.0, -2.0]), 0.8, (5, 3))
    ray = picture_rays(camera, (5, 3))[1, 2]
    toward = camera.target - camera.eye
    np.testing.assert_allclose(
        ray / np.linalg.norm(ray), toward / np.linalg.norm(toward), atol=1e-12
    )
    assert (picture_rays(camera, (5, 3))[0, 2] @ camera.up) > ray @ camera.up


@pytest.mark.parametrize("name", VIEWS)
def test_a_constant_map_is_constant(name):
    out = looked_up(VIEWS[name], np.full((8, 16, 3), 0.25, np.float32))
    np.testing.assert_allclose(out[..., :3], 0.25, rtol=1e-6)


@pytest.mark.gl
@pytest.mark.parametrize("name", VIEWS)
def test_as_opengl_draws_it(ctx, name):
    """Its bilinear weights come in steps of 1/256."""
    radiance = np.random.default_rng(5).random((16, 32, 3), np.float32)
    scene = Scene((), Ground(y_m=-1e6, radius_m=1e-3))
    with Renderer(ctx, scene, VIEWS[name]) as renderer:
        drawn = renderer.render(only_fill(np.zeros((9, 3))), whole_map(radiance))
    assert drawn[..., 3].max() == 0
    np.testing.assert_allclose(
        looked_up(VIEWS[name], radiance)[..., :3], drawn[..., :3], atol=2.5 / 256
    )


def test_a_cell_is_seen_at_its_centre():
    """Rows from the top; +Z in the middle, +X at a quarter of the width."""
    radiance = np.arange(8 * 16 * 3, dtype=np.float32).reshape(8, 16, 3)
    theta = math.pi * (2 + 0.5) / 8
    phi = math.pi - 2 * math.pi * (3 + 0.5) / 16
    direction = np.array(
        [[math.sin(theta) * math.sin(phi), math.cos(theta), math.sin(theta) * math.cos(phi)]]
    )
    out = np.zeros((1, 4), np.float32)
    look_up(radiance, map_coordinates(direction), np.zeros(1, np.int64), out)
    np.testing.assert_allclose(out[0, :3], radiance[2, 3], rtol=1e-5)
