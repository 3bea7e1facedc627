"""A picture that does not change: a glossy sphere on a plane under sixteen lights.

sphere_on_plane.exr was made by the brute-force ray caster, not by the renderer that it judges.
`python -m tests.golden.test_sphere_on_plane` makes it again; do so only if the scene or the
reflectance model is meant to change.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from capture.exr import read_exr, write_exr
from render.opengl.context import is_software
from render.opengl.renderer import Renderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, trace
from tests.render.light_sets import random_lights

GOLDEN = Path(__file__).with_name("sphere_on_plane.exr")
SCENE = SphereScene(
    (0.0, 0.5, 0.0), 0.5, Material((0.7, 0.5, 0.3), roughness=0.4), Ground(0.0, (0.5, 0.4, 0.3), 20)
)
CAMERA = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (64, 48))
LIGHTS = random_lights(16, seed=2005)
SAMPLES_PER_AXIS = 3


def golden():
    channels = read_exr(GOLDEN).channels
    return np.stack([channels[name] for name in "RGBA"], axis=-1)


def test_brute_force_has_not_changed():
    np.testing.assert_allclose(
        trace(SCENE, CAMERA, LIGHTS, SAMPLES_PER_AXIS), golden(), rtol=1e-6, atol=1e-7
    )


@pytest.mark.gl
def test_the_renderer_agrees(ctx):
    if not is_software(ctx):
        pytest.skip("compared on llvmpipe only: drivers rasterise edges differently")
    ball = sphere(SCENE.centre, SCENE.radius_m, SCENE.material, rings=64)
    with Renderer(ctx, Scene((ball,), SCENE.ground), CAMERA, SAMPLES_PER_AXIS) as renderer:
        error = renderer.render(LIGHTS) - golden()
    assert math.sqrt(np.mean(error**2) / np.mean(golden() ** 2)) < 0.01


if __name__ == "__main__":
    picture = trace(SCENE, CAMERA, LIGHTS, SAMPLES_PER_AXIS)
    write_exr(GOLDEN, {name: picture[..., i] for i, name in enumerate("RGBA")}, {})
