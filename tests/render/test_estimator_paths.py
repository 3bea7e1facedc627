"""Light by way of other surfaces: closed forms of a bowl, and Mitsuba's paths."""

import math
from dataclasses import replace

import numpy as np
import pytest

from capture.errors import InputError
from capture.exr import read_exr
from lighting.maps.environment_files import write_environment
from render.estimators.passes import estimate_picture
from render.reference.accumulation import LEAST_PASSES
from render.render_cli import render
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Camera, Material, Scene
from tests.render import estimator_scene

WHITE = estimator_scene.environment(np.ones((8, 16, 3)))


def bowl(albedo, rings=48):
    """Return the lower half of a sphere, open to the sky, and a camera that looks into it."""
    ball = sphere((0.0, 0.0, 0.0), 1.0, Material((albedo,) * 3, specular=0.0), rings)
    below = ball.positions[ball.faces].mean(axis=1)[:, 1] < 0
    scene = Scene((replace(ball, faces=ball.faces[below]),), None)
    return scene, Camera(np.array([0.0, 0.3, 0.0]), np.array([0.3, -0.8, 0.1]), 0.8, (8, 8))


def into(albedo, bounces, light=WHITE, **more):
    scene, camera = bowl(albedo)
    return estimate_picture("paths", scene, camera, light, bounces=bounces, error=0.005, **more)


@pytest.mark.parametrize("bounces", [1, 2, 4])
def test_a_bowl_under_an_even_sky(bounces):
    # Of what any place of a sphere sends out, the same part reaches each other place: half is lost
    # through the opening, and half of all that it sees directly is sky. L = a/2 Σ (a/2)ᵏ.
    albedo = 0.8
    expected = 0.5 * albedo * sum((0.5 * albedo) ** k for k in range(bounces))
    picture = into(albedo, bounces)
    np.testing.assert_allclose(picture.radiance[..., :3].mean(), expected, rtol=0.006)
    off = picture.radiance[..., :3] - expected
    assert math.sqrt(np.mean(off**2)) < 0.02 * expected


def test_a_white_bowl_becomes_as_bright_as_the_sky():
    picture = into(1.0, 16)
    assert picture.radiance[..., :3].mean() == pytest.approx(1.0, abs=0.01)


def test_more_bounces_only_add_light():
    scene, camera = default_scene((16, 12))
    light = estimator_scene.uneven_map(rows=16)
    direct, more = (
        estimate_picture("paths", scene, camera, light, bounces=bounces, error=0.02)
        for bounces in (1, 3)
    )
    other = estimate_picture("mis-balance", scene, camera, light, error=0.02)

    def z_of(difference, *pictures):
        variance = sum((p.standard_error.astype(float) ** 2).sum() for p in pictures)
        return difference.sum(dtype=np.float64) / math.sqrt(variance)

    assert abs(z_of((direct.radiance - other.radiance)[..., :3], direct, other)) < 4
    assert z_of((more.radiance - direct.radiance)[..., :3], direct, more) > 10


def test_the_standard_error_is_true():
    light = estimator_scene.uneven_map()
    scene, camera = bowl(0.8)
    pictures = [
        estimate_picture("paths", scene, camera, light, bounces=3, error=1, samples=4, seed=seed)
        for seed in range(32)
    ]
    assert {picture.passes for picture in pictures} == {LEAST_PASSES}
    told = np.mean([picture.standard_error.astype(float) ** 2 for picture in pictures])
    seen = np.var([picture.radiance[..., :3].astype(float) for picture in pictures], axis=0, ddof=1)
    assert math.sqrt(told / seen.mean()) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize(("name", "bounces"), [("brdf", 2), ("paths", 0)])
def test_bounces_that_are_none_are_refused(name, bounces):
    scene, camera = bowl(0.5)
    with pytest.raises(InputError, match=f"the estimator 'paths'; got {bounces} with '{name}'"):
        estimate_picture(name, scene, camera, WHITE, bounces=bounces)


def test_the_command_counts_bounces(tmp_path, capsys):
    write_environment(tmp_path / "sky.exr", estimator_scene.uneven_map(rows=16))
    arguments = {"environment": tmp_path / "sky.exr", "size": "16x12", "error": 0.5}
    for bounces in (1, 3):
        render(output=tmp_path / f"{bounces}.exr", reference=True, bounces=bounces, **arguments)
    direct, more = (read_exr(tmp_path / f"{bounces}.exr").channels["G"] for bounces in (1, 3))
    assert more.mean() > direct.mean()
    assert "what its lights leave out" not in capsys.readouterr().out
    with pytest.raises(InputError, match="--bounces are for --reference"):
        render(output=tmp_path / "p.exr", lights=tmp_path / "lights.json", bounces=2)


@pytest.mark.slow
@pytest.mark.parametrize("is_glossy", [False, True])
def test_agreement_with_mitsuba(is_glossy):
    pytest.importorskip("mitsuba", reason="Mitsuba is in the development extra")
    import mitsuba as mi

    from tests.render import mitsuba_scene

    mitsuba_scene.use_variant()
    scene, camera = default_scene((32, 24))
    if not is_glossy:
        meshes = (
            replace(mesh, material=Material(mesh.material.base_colour, specular=0.0))
            for mesh in scene.meshes
        )
        scene = replace(scene, meshes=tuple(meshes))
    light = estimator_scene.uneven_map(rows=16)
    ours = estimate_picture("paths", scene, camera, light, bounces=3, error=0.01)
    loaded = mitsuba_scene.load(scene, camera, light)
    path = mi.load_dict({"type": "path", "max_depth": 4, "rr_depth": 99, "hide_emitters": True})
    peers = np.stack(
        [np.array(mi.render(loaded, integrator=path, spp=64, seed=seed)) for seed in range(8)]
    )
    peer, variance = peers.mean(axis=0), peers.var(axis=0, ddof=1) / len(peers)
    off = (ours.radiance[..., :3] - peer).mean(axis=(0, 1))
    squared = ours.standard_error.astype(float) ** 2
    error = np.sqrt((variance + squared).mean(axis=(0, 1)) / (32 * 24))
    assert np.all(np.abs(off) < 4 * error)
    assert error.max() < 0.01 * peer.mean()
