"""Claim    : shadow maps lose the lowest texel and a half of what stands on the ground, no more.

Setup    : a box of 0.5 m on white ground under one point light, 5° to 80° above it; one that sets;
           4,096 lights; a mesh with triangles without area; a ball of a million triangles.
Expected : a receiver is compared √2 texels off its surface, so the far edge of a shadow is short by
           what stands in the way of that height, √2 cos²/sin texels, give or take half a texel;
           at the box it is whole. A setting light's shadow is right at any length. Lights beyond
           what an atlas holds take turns, and none is lost.
Measured : edges within 0.35 texels of where that puts them; the shadow begins in the first pixel
           beside the box (a quarter of a texel). 4,096 lights are 0.15 % off a ray caster, the
           million triangles under one light 0.9 % off rays.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from render.moving.renderer import MovingRenderer
from render.opengl.renderer import KEY_MAP_PX, Renderer
from render.opengl.shadows import texel_width
from render.scenes.casters import gather_casters
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Scene
from tests.render.boxes import WHITE, box
from tests.render.brute_force import SphereScene, away_from_outlines, trace
from tests.render.light_sets import one_light, random_lights

pytestmark = pytest.mark.gl

GROUND = Ground(reflectance=(1, 1, 1))
BOX = box((-0.5, 0, -0.5), (0, 0.5, 0.5))
TEXEL_M = texel_width(gather_casters([BOX]).radius_m, KEY_MAP_PX)


def strip(x_m, width_m):
    """A camera straight above a strip of ground, +X to its right."""
    eye, target = np.array([x_m, 4.0, 1e-4]), np.array([x_m, 0.0, 0.0])
    return Camera(eye, target, 2 * math.atan(width_m / 2 / 4 / 8), (64, 8))


def picture_of(ctx, scene, camera, lights):
    with Renderer(ctx, scene, camera) as renderer:
        return renderer.render(lights)


def low_light(elevation_rad):
    return one_light((-math.cos(elevation_rad), math.sin(elevation_rad), 0), (math.pi,) * 3)


@pytest.mark.parametrize("elevation_deg", [5, 20, 45, 80])
def test_the_far_edge_of_a_shadow(ctx, elevation_deg):
    e = math.radians(elevation_deg)
    length_m = 0.5 / math.tan(e)
    lost_m = math.sqrt(2) * TEXEL_M * math.cos(e) / math.tan(e)
    width_m = 20 * TEXEL_M / math.sin(e)
    lit = picture_of(ctx, Scene((BOX,), GROUND), strip(length_m, width_m), low_light(e))
    shaded_m = width_m * (1 - lit[4, :, 0] / math.sin(e)).mean() - width_m / 2
    assert abs(shaded_m + lost_m) < 0.5 * TEXEL_M / math.sin(e)


@pytest.mark.parametrize("elevation_deg", [20, 45, 80])
def test_a_shadow_begins_at_its_box(ctx, elevation_deg):
    camera = strip(0.0, 16 * TEXEL_M)
    light = low_light(math.radians(elevation_deg))
    lit = picture_of(ctx, Scene((BOX,), GROUND), camera, light)[4, :, 0]
    length = int(4 * 0.5 / math.tan(math.radians(elevation_deg)) / TEXEL_M)
    np.testing.assert_array_equal(lit[33 : min(33 + length - 12, 64)], 0)


def test_the_shadow_of_a_setting_light(ctx):
    # 30 m of shadow: far beyond the sphere around the box, to which its maps are fitted.
    camera = strip(0.5 / math.tan(math.radians(1.0)) - 1, 0.5)
    with Renderer(ctx, Scene((BOX,), GROUND), camera) as renderer:
        for elevation_deg in (0.1, 0.5, 0.99, 1.01, 3, 10, 90):
            e = math.radians(elevation_deg)
            lit = renderer.render(low_light(e))[..., :3]
            if elevation_deg < 1:
                np.testing.assert_array_equal(lit, 0)
            elif elevation_deg > 2:
                np.testing.assert_allclose(lit, math.sin(e), rtol=1e-5)
        for elevation_deg in (0, -0.1, -30, -90):
            np.testing.assert_array_equal(
                renderer.render(low_light(math.radians(elevation_deg)))[..., :3], 0
            )


def test_light_from_below_the_floor_gets_no_map(ctx):
    above = random_lights(5, seed=3, lowest=0.2)
    below = replace(above, directions=above.directions * [1, -1, 1])
    camera = Camera(np.array([1.5, 1.0, 3.0]), np.zeros(3), size_px=(24, 18))
    for ground, maps in ((GROUND, 0), (None, 5)):
        with Renderer(ctx, Scene((BOX,), ground), camera) as renderer:
            assert renderer.draw(above) == 5
            assert renderer.draw(below) == maps


@pytest.mark.slow
def test_4096_lights(ctx):
    ball = SphereScene((0.0, 0.5, 0.0), 0.5, WHITE, GROUND)
    camera = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (16, 16))
    lights = random_lights(4096, seed=1)
    scene = Scene((sphere(ball.centre, 0.5, WHITE, 12),), GROUND)
    truth = trace(ball, camera, lights)
    inside = away_from_outlines(ball, camera)
    with Renderer(ctx, scene, camera, interleaving=1) as renderer:
        off = (renderer.render(lights) - truth)[inside, :3]
    assert math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2)) < 0.005


def test_triangles_without_area_change_nothing(ctx):
    lines = [[0, 0, 0], [0, 1, 1], [2, 2, 3]]
    # And one whose corners are three, on a line.
    count = len(BOX.positions)
    bad = replace(
        BOX,
        positions=np.concatenate([BOX.positions, np.float32([[0, 2, 0], [0, 3, 0], [0, 4, 0]])]),
        normals=np.concatenate([BOX.normals, np.float32([[1, 0, 0]] * 3)]),
        faces=np.concatenate([BOX.faces, np.int32([*lines, [count, count + 1, count + 2]])]),
    )
    camera = Camera(np.array([1.5, 1.0, 3.0]), np.zeros(3), size_px=(48, 36))
    lights = one_light((-1, 1, 0.5))
    good, with_lines = (
        picture_of(ctx, Scene((mesh,), GROUND), camera, lights) for mesh in (BOX, bad)
    )
    assert np.all(np.isfinite(with_lines))
    # The line makes the sphere that maps are fitted to larger, and their texels.
    assert np.mean(np.abs(with_lines - good).max(axis=-1) > 1e-5) < 0.02


def test_a_mesh_of_a_single_point_casts_nothing(ctx):
    point = replace(BOX, positions=np.tile(np.float32([0, 0.2, 0]), (len(BOX.positions), 1)))
    camera = Camera(np.array([1.5, 1.0, 3.0]), np.zeros(3), size_px=(24, 18))
    light = one_light((-1, 1, 0.5))
    alone, with_point = (
        picture_of(ctx, Scene(meshes, GROUND), camera, light) for meshes in ((), (point,))
    )
    np.testing.assert_array_equal(with_point, alone)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_light_that_is_no_number_is_refused(bad):
    for values in ((bad, 1, 1), (0, 1, bad)):
        with pytest.raises(ValueError, match="finite and at least 0"):
            one_light((0, 1, 0), values)


@pytest.mark.slow
def test_a_million_triangles(ctx):
    ball = sphere((0.0, 0.5, 0.0), 0.5, WHITE, 500)
    assert len(ball.faces) == 1_000_000
    camera = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (64, 64))
    scene, light = Scene((ball,), GROUND), one_light((0.6, 1.0, -0.3))
    inside = away_from_outlines(SphereScene((0.0, 0.5, 0.0), 0.5, WHITE, GROUND), camera)
    with MovingRenderer(scene, camera) as rays:
        truth = rays.render(light)[inside, :3]
    off = picture_of(ctx, scene, camera, light)[inside, :3] - truth
    assert math.sqrt(np.mean(off**2) / np.mean(truth**2)) < 0.02
