"""Mirrors drawn with OpenGL: energy, direction, the ground, what hides the map; and rays beside."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.reduce import reduce_to_lights
from lighting.simulation.outdoors import outdoors
from lighting.sphere import harmonics
from lighting.sphere.latlong import grid_to_direction
from render.moving.renderer import MovingRenderer
from render.opengl.renderer import Renderer
from render.rays.embree import Occluders
from render.rays.hidden_sky import basis, hidden_sky
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, away_from_outlines

pytestmark = pytest.mark.gl

CAMERA = Camera(np.array([0.0, 0.5, 3.0]), np.zeros(3), 0.8, (48, 48))
DARK = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
INSIDE = away_from_outlines(SphereScene((0, 0, 0), 1.0, Material(), None), CAMERA)
ROWS = 64


def metal(roughness):
    return Material((1.0, 1.0, 1.0), roughness, metalness=1.0)


def ball(roughness, ground=None):
    return Scene((sphere((0, 0, 0), 1, metal(roughness), 64),), ground)


def directions(rows=ROWS):
    column, row = np.meshgrid(np.arange(2 * rows), np.arange(rows))
    return grid_to_direction(np.stack([column, row], axis=-1), rows)


def whole(radiance):
    seen = np.ones(radiance.shape[:2], bool)
    return EnvironmentMap(np.ascontiguousarray(radiance, np.float32), seen, ~seen)


def furnace(rows=ROWS):
    return whole(np.ones((rows, 2 * rows, 3)))


def room(rows):
    """Walls of a slow gradient, a window and two lamps."""
    away = directions(rows)
    radiance = 0.3 + 0.2 * away[..., :1] * [1.0, 0.5, 0.2] + 0.2 * away[..., 1:2]
    for toward, radius_deg, of in (((0.8, 0.3, 0.5), 25, 4.0), ((-0.4, 0.9, -0.1), 2, 400.0)):
        middle = np.array(toward) / np.linalg.norm(toward)
        radiance[away @ middle > np.cos(np.radians(radius_deg))] += of
    return whole(radiance)


def drawn(ctx, scene, camera, lights, environment):
    with Renderer(ctx, scene, camera) as renderer:
        return renderer.render(lights, environment)[..., :3]


@pytest.mark.parametrize(
    ("roughness", "rows", "bound"), [(0.0, ROWS, 1e-5), (0.1, 45, 0.01), (0.3, ROWS, 0.05)]
)
def test_a_smooth_metal_in_a_white_furnace_is_white(ctx, roughness, rows, bound):
    """But for what facets pass on to each other, and rims, where a few rays pass the surface."""
    seen = drawn(ctx, ball(roughness), CAMERA, DARK, furnace(rows))
    assert_allclose(seen[INSIDE], 1, atol=bound)
    assert_allclose(seen[INSIDE].mean(), 1, atol=0.2 * bound)


@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_a_lobe_is_that_of_rays(ctx, roughness):
    with MovingRenderer(ball(roughness), CAMERA) as renderer:
        expected = renderer.render(DARK, whole(2 + directions()))[..., :3]
    seen = drawn(ctx, ball(roughness), CAMERA, DARK, whole(2 + directions()))
    assert_allclose(seen[INSIDE], expected[INSIDE], atol=0.02)


def test_the_poles_and_the_seam_are_ordinary_places(ctx):
    """The same spot is mirrored wherever the map is turned."""
    reflected, peak = np.zeros(3), np.zeros(3)
    camera_at = ((0.0, 0.0, 3.0), (0.0, 3.0, 0.0), (0.0, 0.0, -3.0))  # images: +Z, +Y, −Z
    for row, eye in enumerate(np.array(camera_at)):
        camera = replace(CAMERA, eye=eye, up=np.array([1.0, 0.0, 0.0]), size_px=(33, 33))
        spot = (directions() @ (eye / 3) > np.cos(np.radians(7))) * 1.0
        spot *= 0.05 / whole(np.repeat(spot[..., None], 3, 2)).integral()[0]
        seen = drawn(ctx, ball(0.25), camera, DARK, whole(np.repeat(spot[..., None], 3, 2)))
        reflected[row], peak[row] = seen[..., 0].mean(), seen[11:22, 11:22, 0].mean()
    assert_allclose(reflected, reflected[0], rtol=0.06)
    assert_allclose(peak, peak[0], rtol=0.1)


@pytest.mark.parametrize("roughness", [0.1, 0.35])
def test_below_the_horizon_a_ball_mirrors_the_ground(ctx, roughness):
    ground = Ground(-1.0, (0.4, 0.3, 0.2), 1000)
    upward = LightSet(np.array([[0.0, 1.0, 0.0]]), np.full((1, 3), np.pi), np.full(1, 0.3))
    dark = whole(np.zeros((ROWS, 2 * ROWS, 3)))
    seen = drawn(ctx, ball(roughness, ground), CAMERA, upward, dark)
    assert_allclose(seen[36, 24], ground.reflectance, rtol=0.05)  # below the middle of the ball


@pytest.mark.parametrize("roughness", [0.25, 0.4])
def test_a_key_light_is_mirrored_once(ctx, roughness):
    """What the map has of it is not mirrored beside its disc."""
    toward = np.array([0.3, 0.6, 1.0]) / np.linalg.norm([0.3, 0.6, 1.0])
    spot = (directions() @ toward > np.cos(np.radians(4)))[..., None]
    irradiance = 99.5 * 2 * np.pi * (1 - np.cos(np.radians(4)))
    key = LightSet(toward[None], np.full((1, 3), irradiance), np.array([np.radians(2.4)]))
    environment = whole(np.where(spot, 100.0, 0.5) * np.ones(3))
    seen = drawn(ctx, ball(roughness), CAMERA, key, environment)
    apart = drawn(ctx, ball(roughness), CAMERA, key, None) + 0.5
    assert_allclose(seen[INSIDE].mean(), apart[INSIDE].mean(), rtol=0.03)
    assert seen[INSIDE].max() > 2


def test_a_ball_does_not_show_the_map_through_another(ctx):
    blocked = Scene((*ball(0.1).meshes, sphere((0, 0, 40.0), 36.0, metal(0.1), 96)), None)
    seen = drawn(ctx, blocked, CAMERA, DARK, furnace())
    assert_allclose(seen[24, 24], 0, atol=0.02)  # mirrors what stands behind the camera


@pytest.mark.parametrize(
    ("roughness", "environment", "bound"),
    [
        (0.1, room(64), 0.14),
        pytest.param(0.1, outdoors(64), 0.12, marks=pytest.mark.slow),
        pytest.param(0.35, room(64), 0.08, marks=pytest.mark.slow),
        (0.35, outdoors(64), 0.07),
        (0.6, room(64), 0.05),
        pytest.param(0.6, outdoors(64), 0.05, marks=pytest.mark.slow),
    ],
)
def test_rays_draw_the_same(ctx, roughness, environment, bound):
    """But for the outlines of what hides the map, which are blurred; highlights are clipped."""
    scene, camera = default_scene((80, 60))
    objects = tuple(replace(mesh, material=metal(roughness)) for mesh in scene.meshes)
    scene = replace(scene, meshes=objects)
    lights = reduce_to_lights(environment, 64)
    with MovingRenderer(scene, camera) as renderer:
        expected = renderer.render(lights, environment)[..., :3]
    most = np.quantile(expected, 0.98)
    expected = np.minimum(expected, most)
    seen = np.minimum(drawn(ctx, scene, camera, lights, environment), most)
    error = np.sqrt(np.mean((seen - expected) ** 2) / np.mean(expected**2))
    assert error < bound
    assert_allclose(seen.mean(), expected.mean(), rtol=0.01)


def test_another_camera_sees_what_a_new_renderer_would(ctx):
    scene = Scene((*ball(0.1).meshes, sphere((2.2, 0, 0), 1, metal(0.3), 24)), None)
    beside = replace(CAMERA, eye=np.array([-2.0, 1.0, 2.5]))
    environment = whole(2 + directions())
    with Renderer(ctx, scene, CAMERA) as renderer:
        renderer.render(DARK, environment)
        renderer.look_from(beside)
        seen = renderer.render(DARK, environment)[..., :3]
    np.testing.assert_array_equal(seen, drawn(ctx, scene, beside, DARK, environment))


def test_harmonics_of_order_3_are_orthonormal_and_begin_with_those_of_order_2():
    column, row = np.meshgrid(np.arange(64), np.arange(32))
    d = grid_to_direction(np.stack([column, row], axis=-1), 32).reshape(-1, 3)
    weight = np.sqrt(np.maximum(1 - d[:, 1] ** 2, 0))
    values = basis(d)
    gram = 4 * np.pi * (values * weight[:, None]).T @ values / weight.sum()
    assert_allclose(gram, np.eye(16), atol=0.01)
    assert_allclose(values[:, :9], harmonics.basis(d))


def test_what_a_wall_hides_is_its_solid_angle_and_on_its_side():
    """A point before an endless wall: half of its sky, which is a quarter of the sphere."""
    wall = np.array([[1, -1e4, -1e4], [1, -1e4, 1e4], [1, 2e4, 0]], np.float32)
    up = np.array([[0, 1, 0]], np.float32)
    with Occluders(wall, np.array([[0, 1, 2]], np.int32)) as occluders:
        hidden = hidden_sky(occluders, np.zeros((1, 3), np.float32), up, 1e-4)[0]
    assert_allclose(hidden[0] * np.sqrt(4 * np.pi), np.pi, rtol=0.03)
    toward, away = basis(np.array([[0.7, 0.7, 0], [-0.7, 0.7, 0]])) @ hidden
    assert toward > 0.8
    assert abs(away) < 0.2
