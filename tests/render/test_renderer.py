"""The renderer against closed forms, its own laws, and a brute-force shading of the same scene."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions
from render.opengl.context import is_software
from render.opengl.renderer import INTERLEAVING, KEY_LIGHTS, Renderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Mesh, Scene
from tests.render.boxes import box
from tests.render.brute_force import trace
from tests.render.drawn_scenes import (
    BALL,
    BALL_CAMERA,
    FROM_ABOVE,
    MATT,
    REFLECTANCE,
    ball_mesh,
    ball_scene,
    picture,
    relative_rmse,
)
from tests.render.light_sets import (
    one_light,
    random_lights,
    scaled,
    selected,
    uniform_fill,
    uniform_lights,
)

pytestmark = pytest.mark.gl

METAL = Material((0.9, 0.6, 0.3), roughness=0.3, metalness=1.0)
HALF_METAL = Material((0.4, 0.5, 0.9), roughness=0.7, metalness=0.5)


@pytest.mark.parametrize(
    ("scene", "lights"),
    [
        (replace(BALL, material=MATT), one_light((1.0, 1.0, 0.5))),
        (BALL, random_lights(8, seed=3)),
        (replace(BALL, material=METAL), random_lights(8, seed=4)),
        (replace(BALL, material=HALF_METAL), random_lights(16, seed=5)),
        # The ground lies beyond the far side of the shadow maps.
        (replace(BALL, centre=(0.0, 0.9, 0.0), radius_m=0.1), one_light((0.0, 1.0, 0.1))),
    ],
    ids=["matt", "glossy", "metal", "half-metal", "far ground"],
)
def test_agrees_with_brute_force(ctx, scene, lights):
    result = picture(ctx, ball_scene(scene), BALL_CAMERA, lights, samples_per_axis=2)
    truth = trace(scene, BALL_CAMERA, lights, samples_per_axis=2)
    error = np.abs(result - truth)[..., :3].max(axis=-1) / truth[..., :3].mean()
    # All pixels, silhouettes and the edges of shadows included.
    assert relative_rmse(result[..., :3], truth[..., :3]) < 0.02
    assert np.abs(result[..., 3] - truth[..., 3]).mean() < 1e-3
    # Away from those edges the two agree to rounding on the ground; on the sphere a polyhedron's
    # points and normals stand for it.
    on_sphere = trace(replace(scene, ground=None), BALL_CAMERA, lights)[..., 3] == 1
    assert np.median(error[~on_sphere]) < 1e-5
    assert np.median(error[on_sphere]) < 1e-3
    assert np.mean(error > 0.01) < 0.05


def test_the_order_of_lights_does_not_matter(ctx):
    lights = random_lights(20, seed=1)
    shuffled = selected(lights, np.random.default_rng(0).permutation(20))
    with Renderer(ctx, ball_scene(), BALL_CAMERA, interleaving=1) as renderer:
        error = np.abs(renderer.render(shuffled) - renderer.render(lights))
    # In another tile of the atlas, coordinates round differently: by a 256th in a shadow's edge.
    assert np.median(error) < 1e-7
    assert error.max() < 0.01


def test_linear_in_irradiance(ctx):
    lights = random_lights(5, seed=2)
    with Renderer(ctx, ball_scene(), BALL_CAMERA) as renderer:
        once, fourfold = renderer.render(lights), renderer.render(scaled(lights, 4.0))
    assert_array_equal(fourfold[..., :3], 4 * once[..., :3])


def test_a_light_more_than_a_batch_adds_itself(ctx):
    batch = KEY_LIGHTS + 4 * INTERLEAVING**2
    lights = random_lights(batch + 1, seed=6)
    scene = Scene((), Ground(0.0, REFLECTANCE))
    with Renderer(ctx, scene, FROM_ABOVE) as renderer:
        together = renderer.render(lights)
        parts = [
            renderer.render(selected(lights, part))[..., :3]
            for part in (slice(0, batch), slice(batch, None))
        ]
    assert_allclose(together[..., :3], parts[0] + parts[1], rtol=1e-6)


def test_taking_turns_takes_nothing_from_what_is_seen(ctx):
    # A convex body alone: each sample sees all lights that its face looks at.
    scene = ball_scene(replace(BALL, ground=None), rings=12)
    lights = uniform_lights(64)
    pictures = [picture(ctx, scene, BALL_CAMERA, lights, interleaving=n) for n in (1, 2, 4)]
    assert_allclose(pictures[1], pictures[0], rtol=1e-6)
    assert_allclose(pictures[2], pictures[0], rtol=1e-6)


def test_turns_are_shared_on_one_surface_only(ctx):
    # A lit plate beside the shadow that it throws on the ground: it stays lit up to its edge.
    scene = Scene((box((-1, 0.5, -1), (1, 0.52, 1)),), Ground(0.0, (1, 1, 1)))
    camera = Camera(np.array([0.0, 4.0, 0.001]), np.zeros(3), math.radians(50), (48, 48))
    slanting = np.repeat([[0.6, 0.8, 0.0]], 20, axis=0)
    many = LightSet(slanting, np.ones((20, 3)) / 20, np.zeros(20))
    result = math.pi * picture(ctx, scene, camera, many, interleaving=INTERLEAVING)[..., 0]
    assert result.min() < 0.3  # the shadow, to the left
    assert_allclose(result[11:-11, 11:-11], 0.8, atol=1e-5)


def test_a_wall_hides_all_of_a_disc_that_is_half_below_the_horizon(ctx):
    floor, wall = box((-1, -0.1, -1), (1, 0, 1)), box((1, -0.1, -3), (1.1, 3, 3))
    camera = Camera(np.array([0.5, 2.0, 0.001]), np.array([0.5, 0, 0]), 0.1, (8, 8))
    light = one_light((1, 0, 0), angular_radius_rad=0.3)
    lit = picture(ctx, Scene((floor,), None), camera, light)[..., 0]
    hidden = picture(ctx, Scene((floor, wall), None), camera, light)[..., 0]
    assert hidden.mean() < 0.15 * lit.mean()


def test_more_lights_than_the_atlas_holds_take_turns(ctx):
    # 1024 fit; the others are drawn over them, and the sum is that of both parts.
    lights = random_lights(1100, seed=7)
    camera = replace(BALL_CAMERA, size_px=(40, 30))
    with Renderer(ctx, ball_scene(rings=12), camera) as renderer:
        together = renderer.render(lights)
        first = renderer.render(selected(lights, slice(0, 1024)))
        # Also 128 px wide, as in the turn of 1100.
        rest = together - first
        again = renderer.render(lights)
    alone = trace(BALL, camera, selected(lights, slice(1024, None)))
    assert_array_equal(again, together)
    assert relative_rmse(rest[..., :3], alone[..., :3]) < 0.1


def test_same_bits_from_kept_and_from_new_maps(ctx):
    if not is_software(ctx):
        pytest.skip("only llvmpipe promises the same bits twice")
    first, second = random_lights(12, seed=8), random_lights(7, seed=9)
    with Renderer(ctx, ball_scene(), BALL_CAMERA) as renderer:
        before = renderer.render(first)
        other = renderer.render(second)
        after = renderer.render(first)
    assert_array_equal(after, before)
    new = picture(ctx, ball_scene(), BALL_CAMERA, second, interleaving=INTERLEAVING)
    assert_array_equal(new, other)


def test_a_pixel_is_the_mean_of_its_samples(ctx):
    lights = random_lights(3, seed=10)
    double = replace(BALL_CAMERA, size_px=(240, 180))
    fine = picture(ctx, ball_scene(), double, lights)
    coarse = picture(ctx, ball_scene(), BALL_CAMERA, lights, samples_per_axis=2)
    expected = fine.reshape(90, 2, 120, 2, 4).mean(axis=(1, 3))
    assert_allclose(coarse, expected, rtol=1e-5, atol=1e-7)
    assert 0 < np.mean((coarse[..., 3] > 0) & (coarse[..., 3] < 1)) < 0.05


def test_the_background_stands_where_the_world_has_it(ctx):
    # Radiance that is linear in direction, so that bilinear look-up adds next to nothing.
    directions = cell_directions(128)
    radiance = (2 + directions).astype(np.float32)
    seen = np.ones((128, 256), bool)
    background = EnvironmentMap(radiance, seen, ~seen)
    nothing = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    tiny = Scene((sphere((0, 0, 0), 1e-3, MATT, 8),), None)
    for eye in ((0, 0, 4.0), (4.0, 0.5, 0.1), (0.3, -4.0, 0.2), (-2.0, 2.0, -2.0)):
        camera = Camera(np.array(eye), np.zeros(3), 1.2, (32, 24))
        result = picture(ctx, tiny, camera, nothing, background=background)
        corner = result[0, 0]
        assert corner[3] == 0
        across, up = camera.half_extent()
        right, upward, backward = camera.axes()
        direction = -backward - across * 31 / 32 * right + up * 23 / 24 * upward
        direction /= np.linalg.norm(direction)
        assert_allclose(corner[:3], 2 + direction, atol=2e-3)


def test_the_extent_of_a_light_widens_its_highlight(ctx):
    # α² + r²/8: a point light on roughness 0.5 (α² = 1/16) shines as one of 0.5 rad radius on α² =
    # 1/32.
    def metal(alpha2):
        material = Material((0.9, 0.9, 0.9), roughness=alpha2**0.25, metalness=1.0)
        return ball_scene(replace(BALL, material=material, ground=None))

    wide = picture(ctx, metal(1 / 32), BALL_CAMERA, one_light((1, 1, 1), angular_radius_rad=0.5))
    rough = picture(ctx, metal(1 / 16), BALL_CAMERA, one_light((1, 1, 1)))
    # Where facets look away from the middle, the light with an extent is still there.
    different = np.abs(wide - rough).max(axis=-1) > 1e-5
    assert np.count_nonzero(different) < 10
    assert wide.max() > 0.1


def test_winding_and_the_sign_of_normals_do_not_matter(ctx):
    mesh = ball_mesh(BALL)
    inside_out = replace(mesh, faces=mesh.faces[:, ::-1], normals=-mesh.normals)
    lights = random_lights(4, seed=11)
    pictures = [
        picture(ctx, Scene((part,), BALL.ground), BALL_CAMERA, lights)
        for part in (mesh, inside_out)
    ]
    # Only the order in which a triangle's corners are interpolated differs.
    error = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    assert np.mean(error > 1e-4) < 0.002


def quad(material, **attributes):
    """Upright unit square that faces +Z, its texture upright."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (4, 1))
    faces = np.int32([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners, normals, faces, material, **attributes)


FRONT = Camera(np.array([0.5, 0.5, 3.0]), np.array([0.5, 0.5, 0.0]), 0.2, (16, 16))


def test_a_texture_is_decoded_and_upright(ctx):
    # sRGB 188 of 255 is 0.503 linear; its corner at u = 0, v = 1 is red.
    texture = np.full((16, 16, 3), 188, np.uint8)
    texture[:8, :8] = (255, 0, 0)
    material = Material((1, 1, 1), specular=0.0, base_colour_texture=texture)
    coordinates = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    scene = Scene((quad(material, texture_coordinates=coordinates),), None)
    result = math.pi * picture(ctx, scene, FRONT, one_light((0, 0, 1)))
    assert_allclose(result[2, 2, :3], [1, 0, 0], atol=1e-3)
    assert_allclose(result[13, 13, :3], 0.5029, atol=2e-3)


def test_normals_that_cancel_leave_no_hole(ctx):
    # Interpolated between opposite normals the sum is zero in the middle of the picture.
    corners = np.float32([[-4, 0, -4], [4, 0, -4], [4, 0, 4], [-4, 0, 4]])
    normals = np.float32([[1, 0, 0], [-1, 0, 0], [-1, 0, 0], [1, 0, 0]])
    mesh = Mesh(corners, normals, np.int32([[0, 1, 2], [0, 2, 3]]))
    camera = Camera(np.array([0.0, 4.0, 0.0]), np.zeros(3), size_px=(3, 3), up=[0.0, 0.0, -1.0])
    result = picture(ctx, Scene((mesh,), None), camera, one_light((0, 1, 0)))
    assert np.all(np.isfinite(result))


def test_nothing_leaks_through_a_surface_without_thickness(ctx):
    # The interpolated normals lean so far that the light behind the face is in front of them.
    leaning = np.tile(np.float32([0.8, 0, 0.6]), (4, 1))
    scene = Scene((replace(quad(MATT), normals=leaning),), None)
    assert picture(ctx, scene, FRONT, one_light((1, 0, -0.1))).max(axis=(0, 1))[0] == 0
    assert picture(ctx, scene, FRONT, one_light((1, 0, 0.1)))[..., 0].min() > 0.01


def test_vertex_colours_are_interpolated_linearly(ctx):
    colour = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    scene = Scene((quad(Material((1, 1, 1), specular=0.0), vertex_colour=colour),), None)
    result = math.pi * picture(ctx, scene, FRONT, one_light((0, 0, 1)))
    half = 3 * math.tan(0.1)
    x = 0.5 + half * (np.arange(16) + 0.5 - 8) / 8
    assert_allclose(result[5, :, 0], x, atol=1e-3)
    assert_allclose(result[:, 5, 1], x[::-1], atol=1e-3)


def test_too_large_a_picture_is_refused_with_the_limit(ctx):
    for size_px in ((20_000, 10), (8192, 8193)):
        camera = replace(BALL_CAMERA, size_px=size_px)
        with pytest.raises(InputError, match="{}×{}".format(*size_px)):
            Renderer(ctx, ball_scene(), camera)


def test_how_far_the_target_is_does_not_change_what_is_seen(ctx):
    way = BALL_CAMERA.target - BALL_CAMERA.eye
    seen = [
        picture(ctx, ball_scene(rings=12), replace(BALL_CAMERA, target=target), random_lights(4, 2))
        for target in (BALL_CAMERA.target, BALL_CAMERA.eye + 2000 * way)
    ]
    assert relative_rmse(*seen) < 0.01


def test_another_camera_sees_what_a_new_renderer_would(ctx):
    lights = replace(random_lights(20, seed=14), fill=uniform_fill(0.2))
    background = EnvironmentMap(
        np.random.default_rng(0).random((8, 16, 3), np.float32),
        np.ones((8, 16), bool),
        np.zeros((8, 16), bool),
    )
    other = replace(BALL_CAMERA, eye=np.array([-1.5, 0.8, 2.0]))
    with Renderer(ctx, ball_scene(rings=12), BALL_CAMERA) as renderer:
        renderer.render(lights)
        renderer.look_from(other)
        moved = renderer.render(lights, background)
        with pytest.raises(InputError, match="one"):
            renderer.look_from(replace(other, size_px=(8, 8)))
    expected = picture(
        ctx, ball_scene(rings=12), other, lights, background=background, interleaving=INTERLEAVING
    )
    assert_array_equal(moved, expected)


def test_how_many_samples_share_is_a_power_of_two(ctx):
    with pytest.raises(InputError, match="not 3"):
        Renderer(ctx, ball_scene(rings=8), BALL_CAMERA, interleaving=3)


def test_a_renderer_can_follow_another(ctx):
    lights = random_lights(2, seed=12)
    for _ in range(3):
        assert picture(ctx, ball_scene(rings=8), BALL_CAMERA, lights).max() > 0
        assert ctx.error == "GL_NO_ERROR"
