"""The albedo of the ground that a map shows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from lighting.maps.environment import EnvironmentMap
from lighting.photometry.albedo import ground_albedo
from lighting.photometry.illuminance import cosine_weights

ALBEDO = np.array([0.1, 0.3, 0.9])


def over_ground(sky, albedo=ALBEDO):
    """Return a sky (N / 2, 2N, 3) over a Lambertian ground, all of it seen."""
    height = 2 * len(sky)
    up = cosine_weights(height, (0, 1, 0))[: len(sky)]
    ground = albedo * np.einsum("rc,rcx->x", up, sky) / np.pi
    radiance = np.concatenate([sky, np.broadcast_to(ground, sky.shape)]).astype(np.float32)
    seen = np.ones(radiance.shape[:2], bool)
    return EnvironmentMap(radiance, seen, ~seen)


def with_seen(environment, valid):
    return EnvironmentMap(environment.radiance, valid, environment.clipped)


def test_a_uniform_sky_gives_the_ground_its_albedo_back():
    # A sky of radiance L lights the ground with πL, which sends back ρL.
    environment = over_ground(np.full((16, 64, 3), 2.5))
    assert_allclose(environment.radiance[-1, 0], 2.5 * ALBEDO, rtol=1e-6)
    found = ground_albedo(environment)
    assert_allclose(found.reflectance, ALBEDO, rtol=1e-6)
    assert found.seen_share == pytest.approx(1)


def test_so_does_any_other_sky():
    sky = np.random.default_rng(1).uniform(0, 2, (16, 64, 3))
    sky[5, 40] = (3e3, 2e3, 1e3)
    assert_allclose(ground_albedo(over_ground(sky)).reflectance, ALBEDO, rtol=1e-5)


def test_ground_that_was_not_seen_counts_as_the_rest():
    environment = over_ground(np.full((16, 64, 3), 1.0))
    valid = environment.valid.copy()
    valid[16:, 20:] = False
    radiance = np.where(valid[..., None], environment.radiance, 7.0)
    part = EnvironmentMap(radiance.astype(np.float32), valid, ~valid)
    found = ground_albedo(part)
    assert_allclose(found.reflectance, ALBEDO, rtol=1e-6)
    assert found.seen_share == pytest.approx(20 / 64)


def test_it_is_unknown_where_ground_or_sky_was_not_seen_or_there_is_no_light():
    environment = over_ground(np.full((16, 64, 3), 1.0))
    for unseen in (np.s_[16:], np.s_[:12]):
        valid = environment.valid.copy()
        valid[unseen] = False
        assert ground_albedo(with_seen(environment, valid)) is None
    assert ground_albedo(over_ground(np.zeros((16, 64, 3)))) is None


def test_no_ground_sends_back_more_than_it_receives():
    assert_allclose(ground_albedo(over_ground(np.ones((16, 64, 3)), albedo=1.5)).reflectance, 1)
