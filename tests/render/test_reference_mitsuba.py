"""The reference renderer against Mitsuba 3, within the standard errors of both."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions
from render.reference.sampled_light import Rays
from render.reference.tracing import render_reference
from render.scenes.default_scene import default_scene
from render.scenes.scene import Material, Scene

pytest.importorskip("mitsuba", reason="Mitsuba is in the development extra")
from tests.render import mitsuba_scene

RENDERS, SAMPLES = 16, 32


@pytest.fixture(scope="module", autouse=True)
def variant():
    return mitsuba_scene.use_variant()


def two_suns_and_a_sky(rows=64):
    directions = cell_directions(rows)

    def lobe(toward, width_rad, radiance, colour):
        cosine = directions @ (np.array(toward) / np.linalg.norm(toward))
        return radiance * np.exp((cosine - 1) / width_rad**2)[..., None] * colour

    x, y, z = np.moveaxis(directions, -1, 0)
    sky = (0.3 + 0.3 * y + 0.2 * x * z)[..., None] * [1.0, 0.9, 0.7]
    suns = lobe((0.5, 0.6, -0.6), 0.07, 80, [1, 0.9, 0.7]) + lobe(
        (-8, 3, -2), 0.14, 6, [0.3, 0.5, 1]
    )
    seen = np.ones((rows, 2 * rows), bool)
    return EnvironmentMap((sky + suns).astype(np.float32), seen, ~seen)


def matt(scene):
    return replace(
        scene,
        meshes=tuple(
            replace(mesh, material=Material(mesh.material.base_colour, specular=0.0))
            for mesh in scene.meshes
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["matt", "glossy", "without a ground"])
def test_agreement_within_three_standard_errors(kind):
    scene, camera = default_scene((32, 24))
    if kind == "matt":
        scene = matt(scene)
    if kind == "without a ground":
        scene = Scene(scene.meshes, None)
    light = two_suns_and_a_sky()
    picture = render_reference(scene, camera, light, error=0.02, spent=Rays(2, 16, 4))
    loaded = mitsuba_scene.load(scene, camera, light)
    peers = np.stack([mitsuba_scene.render(loaded, SAMPLES, seed) for seed in range(RENDERS)])
    peer, variance = peers.mean(axis=0), peers.var(axis=0, ddof=1) / RENDERS
    ours, squared = picture.radiance[..., :3], picture.standard_error.astype(float) ** 2

    off = (ours - peer).mean(axis=(0, 1))
    error = np.sqrt((variance + squared).mean(axis=(0, 1)) / (32 * 24))
    assert np.all(np.abs(off) < 3 * error)
    known = variance + squared > 0
    z = (ours - peer)[known] / np.sqrt(variance + squared)[known]
    assert np.mean(np.abs(z) > 3) < 0.05  # Mitsuba's spread has a long tail: 1 to 4 %
    assert error.max() < 0.015 * peer.mean()
