"""Light from the floor, against paths that meet two surfaces."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lighting.light_set import LightSet
from render.estimators.passes import estimate_picture
from render.lights.all_lights import all_lights, level_irradiance
from render.rays.floor_light import add_floor_light, floor_shade, open_floor
from render.rays.surface_rows import empty_surfaces
from render.rays.traced_scene import TracedScene
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.light_sets import uniform_fill

N = 4
CAMERA = Camera(np.array([0.0, 0.6, 4.0]), np.array([0.0, 0.5, 0.0]), math.radians(12), (12, 12))
BALL = sphere((0.0, 0.5, 0.0), 0.5, Material((0.8, 0.5, 0.3), specular=0.0))
SCENE = Scene((BALL,), Ground(0.0, (0.6, 0.5, 0.4), 1000.0))
LIGHTS = LightSet(
    np.array([[0.6, 0.64, 0.48]]),
    np.array([[2.0, 2.0, 1.5]]),
    np.array([0.1]),
    fill=uniform_fill(0.5),
)


def of_floor(shade_of):
    """Return what the ball reflects of the floor, (12, 12, 3); `shade_of` a scene and lights."""
    fine = replace(CAMERA, size_px=(N * 12, N * 12))
    surfaces, picture = empty_surfaces(fine.size_px), np.zeros((N * 12, N * 12, 4), np.float32)
    discs = all_lights(LIGHTS, SCENE)
    radiance = level_irradiance(*discs) * SCENE.ground.reflectance / np.pi
    traced = TracedScene(SCENE)
    traced.find_surfaces(fine, fine.size_px, surfaces)
    add_floor_light(traced, surfaces, radiance, shade_of(traced, discs), picture)
    traced.release()
    return picture.reshape(12, N, 12, N, 4).mean(axis=(1, 3))[..., :3]


@pytest.mark.slow
def test_it_is_what_paths_bring_by_way_of_the_ground():
    """A lone ball: all light with two surfaces on its way meets the floor first."""
    direct, twice = (
        estimate_picture("paths", SCENE, CAMERA, LIGHTS, error=0.008, bounces=bounces).radiance
        for bounces in (1, 2)
    )
    # Seen from 4 m through 12°, the picture shows the ball, but for its corners.
    rows, columns = np.mgrid[:12, :12] - 5.5
    ball = np.hypot(rows, columns) < 5.5
    brought = (twice - direct)[ball, :3]

    def error(found):
        return np.sqrt(np.mean((found[ball] - brought) ** 2) / np.mean(twice[ball, :3] ** 2))

    assert np.sqrt(np.mean(brought**2) / np.mean(twice[ball, :3] ** 2)) > 0.2
    assert error(of_floor(lambda traced, discs: floor_shade(traced, *discs))) < 0.01
    # As if the sky were even, whatever it is.
    assert error(of_floor(lambda traced, _: open_floor(traced))) < 0.03
