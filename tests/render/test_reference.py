"""The ray-traced reference: closed forms, another ray caster, and whether its error is true."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.reference.accumulation import LEAST_PASSES
from render.reference.sampled_light import Rays
from render.reference.tracing import render_reference
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Camera, Ground, Material, Mesh, Scene
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, reflectance, trace
from tests.render.light_sets import one_light, only_fill, uniform_fill

WHITE = (1.0, 0.9, 0.8)
MANY = {"spent": Rays(2, 512, 512), "pool_size": 1 << 14, "error": 1}
FEW = {"spent": Rays(2, 4, 2), "pool_size": 1 << 12, "error": 1}


def constant_map(radiance, rows=8):
    seen = np.ones((rows, 2 * rows), bool)
    return EnvironmentMap(np.full((rows, 2 * rows, 3), radiance, np.float32), seen, ~seen)


def speckled_map(seed=0, rows=16):
    """A map whose brightest cells outshine the rest a thousand times."""
    rng = np.random.default_rng(seed)
    radiance = (rng.random((rows, 2 * rows, 3)) + 0.2) * 10 ** (3 * rng.random((rows, 2 * rows, 1)))
    seen = np.ones((rows, 2 * rows), bool)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


def square(material, half_m=1.0, normal=(0.0, 1.0, 0.0)):
    """A level square around the origin, two triangles that share no vertex with anything."""
    corners = half_m * np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.array([[0, 1], [0, 0], [1, 0], [1, 1]], np.float32)  # u along x, v along −z
    return Mesh(corners, np.tile(np.float32(normal), (4, 1)), faces, material, uv)


def looking_at(target, toward_eye, distance_m=3.0, fov_rad=1e-3, size_px=(4, 4)):
    direction = np.asarray(toward_eye, float) / np.linalg.norm(toward_eye)
    target = np.asarray(target, float)
    return Camera(target + distance_m * direction, target, fov_rad, size_px)


def test_a_plane_under_a_constant_map():
    scene = Scene((), Ground(0.0, (0.5, 0.25, 0.75)))
    picture = render_reference(scene, looking_at((0, 0, 0), (1, 1, 0)), constant_map((1, 2, 3)))
    # E = π L on a plane that sees half of everything; L_o = ρ E / π.
    np.testing.assert_allclose(picture.radiance[0, 0], (0.5, 0.5, 2.25, 1), rtol=2e-3)
    assert picture.shadow_rays == 0


@pytest.mark.parametrize("light", [constant_map(1.0), only_fill(uniform_fill(1.0))])
def test_a_disc_above_a_plane(light):
    turn = np.linspace(0, 2 * np.pi, 128, endpoint=False)
    rim = np.stack([np.sin(turn), np.ones(128), np.cos(turn)], axis=-1)
    positions = np.vstack([[0, 1, 0], rim]).astype(np.float32)
    corner = np.arange(128)
    faces = np.stack([0 * corner, corner + 1, (corner + 1) % 128 + 1], -1).astype(np.int32)
    disc = Mesh(positions, np.tile(np.float32([0, 1, 0]), (129, 1)), faces)
    camera = looking_at((0, 0, 0), (3, 0.4, 0))
    picture = render_reference(Scene((disc,), Ground(0.0)), camera, light, **MANY)
    # The disc of radius 1 at height 1 takes R²/(R² + h²) = ½ of the irradiance of a full sky.
    error = picture.standard_error.max()
    np.testing.assert_allclose(picture.radiance[..., :3], 0.25, atol=5 * error)
    assert 0 < error < 0.002


@pytest.mark.parametrize(
    "material",
    [
        Material(WHITE, roughness=0.3, metalness=1.0),
        Material(WHITE, roughness=1.0, metalness=1.0),
        Material(WHITE, roughness=0.5),
        Material(WHITE, roughness=0.6, metalness=0.4, specular=0.5),
    ],
)
def test_a_furnace_loses_what_the_model_loses(material):
    toward_eye = np.array([1.0, 0.7, 0.3])
    toward_eye /= np.linalg.norm(toward_eye)
    scene = Scene((square(material),), None)
    picture = render_reference(
        scene, looking_at((0.1, 0, 0.2), toward_eye), constant_map(1.0), **MANY
    )
    # ∫ f n·l dω by the midpoint rule, in cos θ and φ; the map is 1 everywhere.
    n = 1000
    up, turn = np.meshgrid((np.arange(n) + 0.5) / n, 2 * np.pi * (np.arange(n) + 0.5) / n)
    level = np.sqrt(1 - up**2)
    toward_light = np.stack([level * np.sin(turn), up, level * np.cos(turn)], axis=-1)
    f = reflectance(material, np.array([0.0, 1.0, 0.0]), toward_eye, toward_light)
    expected = 2 * np.pi * (f * up[..., None]).mean(axis=(0, 1))
    np.testing.assert_allclose(picture.radiance[..., :3].mean(axis=(0, 1)), expected, rtol=2e-3)


@pytest.mark.slow
def test_a_sphere_and_its_shadow_as_an_independent_ray_caster_sees_them():
    ball = SphereScene(
        (0.0, 0.5, 0.0), 0.5, Material((0.7, 0.5, 0.3), 0.5), Ground(0.0, (0.5, 0.4, 0.3), 20.0)
    )
    camera = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (20, 15))
    directions = np.array([[0.5, 0.7, 0.2], [-0.6, 0.5, 0.6], [0.2, 0.9, -0.5]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    irradiance = np.array([[2.0, 1.5, 1.0], [0.5, 1.0, 2.0], [1.0, 1.0, 1.0]])
    lights = LightSet(directions, irradiance, np.array([0.3, 0.1, 0.0]), fill=uniform_fill(0.3))
    truth = trace(ball, camera, as_points(lights, per_light=64, per_fill=400))
    scene = Scene((sphere(ball.centre, ball.radius_m, ball.material, 96),), ball.ground)
    picture = render_reference(scene, camera, lights, error=0.008, seconds=5)
    inside = away_from_outlines(ball, camera)
    off = (picture.radiance - truth)[inside, :3]
    assert math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2)) < 0.02
    assert abs(off.mean()) < 0.003 * truth[inside, :3].mean()


def test_the_standard_error_is_true():
    scene, camera = default_scene((48, 36))
    light, renders = speckled_map(), 24
    pictures = [render_reference(scene, camera, light, seed=seed, **FEW) for seed in range(renders)]
    assert {picture.passes for picture in pictures} == {LEAST_PASSES}
    told = np.mean([picture.standard_error.astype(float) ** 2 for picture in pictures])
    seen = np.var([picture.radiance[..., :3].astype(float) for picture in pictures], axis=0, ddof=1)
    assert math.sqrt(told / seen.mean()) == pytest.approx(1, abs=0.1)


@pytest.mark.slow
def test_directions_of_the_lobe_change_the_error_only():
    scene, camera = default_scene((32, 24))
    light = speckled_map(1)
    with_lobe, without = (
        render_reference(scene, camera, light, error=0.05, spent=Rays(2, 16, lobe))
        for lobe in (4, 0)
    )
    off = with_lobe.radiance[..., :3].mean(axis=(0, 1)) - without.radiance[..., :3].mean((0, 1))
    # Σ over pixels; neighbours' errors are nearly independent, or differ in sign.
    variance = sum((p.standard_error.astype(float) ** 2).mean((0, 1)) for p in (with_lobe, without))
    assert np.all(np.abs(off) < 5 * np.sqrt(variance / (32 * 24)))
    assert with_lobe.relative_error > 0


def test_a_texture_lies_as_its_coordinates_say():
    texels = np.zeros((2, 2, 3), np.uint8)
    texels[0, 1] = 255, 0, 0  # row 0 is at v = 1: the corner of +x, −z
    scene = Scene(
        (square(Material((1.0, 1.0, 1.0), specular=0.0, base_colour_texture=texels)),), None
    )
    seen = {
        (x, z): render_reference(
            scene, looking_at((x, 0, z), (0, 1, 0.1)), constant_map(1.0), **FEW
        )
        for x in (-0.5, 0.5)
        for z in (-0.5, 0.5)
    }
    for (x, z), picture in seen.items():
        red = 1.0 if (x, z) == (0.5, -0.5) else 0.0
        np.testing.assert_allclose(picture.radiance[0, 0], (red, 0, 0, 1), atol=1e-2)


def test_a_surface_seen_from_behind_faces_the_eye():
    light = one_light((0, -1, 0), irradiance=(np.pi, np.pi, np.pi))
    scene = Scene((square(Material((0.5, 0.5, 0.5), specular=0.0)),), None)
    below = render_reference(scene, looking_at((0, 0, 0), (0.3, -1, 0)), light)
    above = render_reference(scene, looking_at((0, 0, 0), (0.3, 1, 0)), light)
    np.testing.assert_allclose(below.radiance[..., :3], 0.5, rtol=1e-5)
    assert not above.radiance[..., :3].any()


def test_light_from_below_a_ground_reaches_nothing():
    light = one_light((0.1, -1, 0), angular_radius_rad=0.2)
    half = one_light((1, 0, 0), angular_radius_rad=0.2)  # half of it stands above the horizon
    scene = Scene((sphere((0, 1, 0), 0.5, Material(specular=0.0)),), Ground(0.0))
    camera = looking_at((0, 1, 0), (1, -0.3, 0), fov_rad=0.6)
    assert not render_reference(scene, camera, light, **FEW).radiance[..., :3].any()
    whole = render_reference(replace(scene, ground=None), camera, half, **MANY).radiance
    cut = render_reference(scene, camera, half, **MANY).radiance
    middle = slice(1, 3), slice(1, 3)
    assert cut[middle][..., :3].mean() == pytest.approx(
        0.5 * whole[middle][..., :3].mean(), rel=0.1
    )


def test_darkness_is_black_and_known():
    scene, camera = default_scene((8, 8))
    picture = render_reference(scene, camera, constant_map(0.0), **FEW)
    assert not picture.radiance[..., :3].any()
    assert picture.relative_error == 0


def test_the_same_seed_gives_the_same_picture():
    scene, camera = default_scene((20, 13))
    first, again = (render_reference(scene, camera, speckled_map(), **FEW) for _ in range(2))
    np.testing.assert_array_equal(first.radiance, again.radiance)
    other = render_reference(scene, camera, speckled_map(), seed=1, **FEW)
    assert (other.radiance != first.radiance).any()


def test_passes_end_at_the_error_or_the_time():
    scene, camera = default_scene((24, 18))
    told = []
    picture = render_reference(
        scene,
        camera,
        speckled_map(),
        error=0.05,
        on_pass=lambda progress: told.append((progress.passes, progress.relative_error)),
    )
    assert picture.relative_error <= 0.05 < told[-2][1]
    assert told[-1] == (picture.passes, picture.relative_error)
    assert (
        render_reference(scene, camera, speckled_map(), error=0, seconds=0).passes == LEAST_PASSES
    )
