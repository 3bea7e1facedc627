"""Claim    : a lamp cut into many lights has a softer shadow than it should, by rays and transport.

Setup    : a matt ball on the ground under a lamp of 2.5°, as 8 or 64 lights that tile it, none of
           them a key light. A reduction to 256 lights cuts a lamp that outshines all else so.
Expected : lights below a tenth of all light share their rays among 4 × 4 pixels, and below a
           fiftieth, or beyond the eighth, are spread over transport's cells of 9°. Within 1 % of
           the lamp by transport as 8 lights, 6 % as 64; by rays within 6 % of 64 × 64 pixels.
Measured : transport 0.6 and 4.4 %, rays 4.4 and 4.7 %; the lights themselves 0.5 and 0.2 %.
"""

import math

import numpy as np
import pytest

from lighting.light_set import LightSet
from render.baked.renderer import BakedRenderer
from render.moving.renderer import MovingRenderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.light_sets import one_light

BALL = SphereScene(
    (0.0, 0.5, 0.0), 0.5, Material((0.6, 0.6, 0.6), specular=0.0), Ground(0.0, (0.5, 0.5, 0.5), 20)
)
SCENE = Scene((sphere(BALL.centre, BALL.radius_m, BALL.material, 64),), BALL.ground)
CAMERA = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (64, 64))
RADIUS_RAD = math.radians(2.5)
LAMP = one_light((0.6, 1.0, -0.3), angular_radius_rad=RADIUS_RAD)


def parts(count):
    points = as_points(LAMP, per_light=count)
    radius_rad = np.full(count, RADIUS_RAD / math.sqrt(count))
    return LightSet(points.directions, points.irradiance, radius_rad)


@pytest.fixture(scope="module")
def truth():
    return trace(BALL, CAMERA, as_points(LAMP))


@pytest.mark.parametrize("kind", [BakedRenderer, MovingRenderer])
@pytest.mark.parametrize("count", [8, 64])
def test_a_lamp_in_parts(kind, count, truth):
    inside = away_from_outlines(BALL, CAMERA)
    with kind(SCENE, CAMERA) as renderer:
        off = (renderer.render(parts(count)) - truth)[inside, :3]
    bound = {(BakedRenderer, 8): 0.01, (BakedRenderer, 64): 0.06}.get((kind, count), 0.06)
    assert math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2)) < bound
