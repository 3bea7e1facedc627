"""Claim    : rays have no texels: no acne, no detached shadows, thin plates cast, at any light.

Setup    : a ball of 16,384 triangles alone under a point light at any angle; a box that stands on
           the ground; a plate 0.1 mm thick; light below the floor; 4,096 lights; a mesh with
           triangles without area; one wide light from 20° above the ground; a single ray per pixel
           to wide lights.
Expected : as the ray caster, but for the two last. Rays start 1e-4 of the casters' radius off their
           surface, so a shadow starts that far from its object. What neighbours share is blurred by
           four pixels, and each point of a disc counts alike, whatever its cosine.
Measured : ball 2e-5 off; the box's shadow starts in the first pixel (1.6 mm); the plate's is 2 %
           of its width off; the wide light's picture is 4 to 5 % off, its mean up to 1.4 %.
"""

import math
import subprocess
import sys

import numpy as np
import pytest

from lighting.light_set import LightSet
from render.moving.renderer import MovingRenderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Mesh, Scene
from tests.render.boxes import WHITE, box
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.light_sets import one_light, random_lights

GROUND = Ground(reflectance=(1, 1, 1))


def picture_of(scene, camera, lights):
    with MovingRenderer(scene, camera) as renderer:
        return renderer.render(lights)


@pytest.mark.parametrize("side", [(1, 0, 0.02), (0.05, 0.1, -1), (0, 1, 0)])
def test_no_acne_on_a_ball(side):
    ball = SphereScene((0.0, 0.5, 0.0), 0.5, WHITE, None)
    camera = Camera(np.array([0.0, 0.9, 2.0]), np.array([0.0, 0.5, 0.0]), 0.6, (64, 64))
    scene = Scene((sphere(ball.centre, 0.5, WHITE, 64),), None)
    truth = trace(ball, camera, one_light(side))
    inside = away_from_outlines(ball, camera) & (truth[..., 3] == 1)
    off = picture_of(scene, camera, one_light(side))[inside, 0] - truth[inside, 0]
    # A face's horizon is up to half a facet (1.4°) off the ball's.
    assert np.abs(off).max() < math.sin(math.radians(2.9)) / math.pi
    assert math.sqrt(np.mean(off**2)) < 1e-3


def test_a_shadow_touches_its_box():
    """Seen from above: the ground right beside the box's shaded side is dark."""
    scene = Scene((box((-0.5, 0, -0.5), (0, 0.5, 0.5), WHITE),), GROUND)
    camera = Camera(np.array([0.02, 2.0, 0.0001]), np.array([0.02, 0.0, 0.0]), 0.05, (64, 64))
    picture = picture_of(scene, camera, one_light((-1, 1, 0)))
    pixel_m = 2 * 2 * math.tan(0.025) / 64
    first = math.ceil(32 - 0.02 / pixel_m)  # the column whose left edge is just right of the box
    assert np.all(picture[8:-8, first + 1 : first + 20, 0] == 0)


def test_a_plate_of_a_tenth_of_a_millimetre_casts():
    plate = box((-0.5, 0.2, -5e-5), (0.5, 1.2, 5e-5))
    camera = Camera(np.array([-1.2, 4.0, 1e-4]), np.array([-1.2, 0.0, 0.0]), 2e-4, (16, 64))
    light = one_light((math.cos(0.7), math.sin(0.7), 0.0), (math.pi,) * 3)
    lit = picture_of(Scene((plate,), GROUND), camera, light)[..., 0] / light.directions[0, 1]
    width_m = (1 - lit).sum(axis=0).mean() * 2 * 4 * math.tan(1e-4) / 64
    assert width_m == pytest.approx(1e-4, rel=0.15)


def test_light_from_below_the_floor_reaches_nothing():
    scene = Scene((box((-0.5, 0.5, -0.5), (0.5, 1, 0.5), WHITE),), GROUND)
    camera = Camera(np.array([1.0, 1.0, 3.0]), np.zeros(3), size_px=(32, 24))
    assert not picture_of(scene, camera, one_light((0.1, -1, 0)))[..., :3].any()


def test_4096_lights():
    ball = SphereScene((0.0, 0.5, 0.0), 0.5, WHITE, GROUND)
    camera = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (32, 32))
    lights = random_lights(4096, seed=1)
    scene = Scene((sphere(ball.centre, 0.5, WHITE, 64),), GROUND)
    truth = trace(ball, camera, lights)
    inside = away_from_outlines(ball, camera)
    off = (picture_of(scene, camera, lights) - truth)[inside, :3]
    assert math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2)) < 0.02


def test_triangles_without_area_are_passed_over():
    good = box((-0.5, 0, -0.5), (0.5, 1, 0.5), WHITE)
    faces = np.concatenate([good.faces, [[0, 0, 0], [0, 1, 1], [2, 2, 3]]]).astype(np.int32)
    bad = Mesh(good.positions, good.normals, faces, good.material)
    camera = Camera(np.array([1.0, 1.0, 3.0]), np.zeros(3), size_px=(32, 24))
    light = one_light((1, 1, 0.5))
    expected = picture_of(Scene((good,), GROUND), camera, light)
    np.testing.assert_array_equal(picture_of(Scene((bad,), GROUND), camera, light), expected)


@pytest.mark.parametrize("radius_deg", [5, 20])
def test_a_single_wide_light(radius_deg):
    ball = SphereScene((0.0, 0.5, 0.0), 0.5, Material((0.6,) * 3, specular=0.0), GROUND)
    camera = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (64, 64))
    light = one_light((0.6, 1.0, -0.3), angular_radius_rad=math.radians(radius_deg))
    scene = Scene((sphere(ball.centre, 0.5, ball.material, 64),), GROUND)
    truth = trace(ball, camera, as_points(light))
    inside = away_from_outlines(ball, camera)
    picture = picture_of(scene, camera, light)
    off = (picture - truth)[inside, :3]
    assert math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2)) < 0.06
    assert picture[inside, 0].mean() == pytest.approx(truth[inside, 0].mean(), rel=0.02)


def test_a_mirror_stays_dark_where_no_light_is():
    """Without a map only lights are reflected: a polished ball in an empty sky is black."""
    metal = Material((1.0, 1.0, 1.0), roughness=0.1, metalness=1.0)
    camera = Camera(np.array([0.0, 0.5, 3.0]), np.array([0.0, 0.5, 0.0]), 0.6, (32, 32))
    scene = Scene((sphere((0, 0.5, 0), 0.5, metal, 32),), None)
    picture = picture_of(scene, camera, one_light((0, 1, 0)))
    assert np.median(picture[picture[..., 3] == 1, 0]) < 1e-3


def test_nan_is_refused_before_it_reaches_a_picture():
    with pytest.raises(ValueError, match="finite"):
        LightSet(np.array([[0.0, 1, 0]]), np.full((1, 3), np.nan), np.zeros(1))


def test_no_opengl_is_needed():
    code = "import sys, render.moving.renderer; sys.exit('moderngl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.slow
def test_a_million_triangles():
    ball = sphere((0.0, 0.5, 0.0), 0.5, WHITE, 500)
    camera = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (64, 64))
    light = one_light((0.6, 1.0, -0.3))
    assert len(ball.faces) == 1_000_000
    with MovingRenderer(Scene((ball,), GROUND), camera) as renderer:
        before = renderer.render(light)
        renderer.move(Scene((sphere((0.0, 0.5, 0.0), 0.5, WHITE, 500),), GROUND))
        np.testing.assert_allclose(renderer.render(light), before, atol=1e-5)
