"""Taking lights out of a map: each exactly once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.export.residual import remove_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import environment, normals
from tests.lighting.room import LAMPS, lamps, room

HEIGHT = 32


def one_light(direction, irradiance, radius=0.1):
    direction = np.asarray(direction, np.float64)
    unit = direction / np.linalg.norm(direction)
    return LightSet(unit[None], np.array([irradiance], np.float64), np.array([radius]))


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 6),
    contrast=st.sampled_from([0.0, 1.0, 1e3, 1e6]),
    radius=st.floats(0, 3.2),
)
@settings(max_examples=40, deadline=None)
def test_residual_and_removed_are_the_map(seed, count, contrast, radius):
    rng = np.random.default_rng(seed)
    radiance = rng.random((8, 16, 3)) * (1 + contrast * (rng.random((8, 16, 1)) > 0.95))
    valid, clipped = rng.random((2, 8, 16)) > 0.5
    before = EnvironmentMap(radiance.astype(np.float32), valid, clipped)
    chosen = normals()[rng.integers(0, 192, count)]
    lights = LightSet(
        chosen, rng.random((count, 3)) * (1 + contrast) / 10, np.full(count, min(radius, np.pi))
    )
    after, removed = remove_lights(before, lights)
    np.testing.assert_allclose(after.integral() + removed.sum(axis=0), before.integral(), rtol=1e-6)
    assert np.all(after.radiance >= 0)
    assert np.all(after.radiance <= before.radiance)
    assert np.all(removed >= 0)
    assert np.all(removed <= lights.irradiance + 1e-6 * before.integral())
    np.testing.assert_array_equal(after.valid, valid)
    np.testing.assert_array_equal(after.clipped, clipped)


def test_lamps_leave_the_walls_behind_them():
    lights = lamps()
    keys = LightSet(lights.directions[:2], lights.irradiance[:2], lights.angular_radius_rad[:2])
    residual, removed = remove_lights(room(), keys)
    np.testing.assert_allclose(removed, keys.irradiance, rtol=1e-5)
    # The walls fall off across a lamp, its cut is level: they differ by what they vary there.
    assert residual.radiance.max() < 0.45
    directions = cell_directions(64)
    far = np.ones((64, 128), bool)
    for direction, radius, _ in LAMPS:
        cosine = directions @ np.array(direction) / np.linalg.norm(direction)
        far &= cosine < np.cos(2 * radius + 2 * np.pi / 64)
    np.testing.assert_array_equal(residual.radiance[far], room().radiance[far])


def test_a_disc_on_an_even_wall_is_removed_without_a_trace():
    disc = cell_directions(HEIGHT) @ np.array([0.6, 0.0, 0.8]) > np.cos(0.15)
    before = environment(np.where(disc, 50.25, 0.25))
    irradiance = 50.0 * (solid_angles(HEIGHT) @ disc.sum(axis=1))
    residual, _ = remove_lights(before, one_light([0.6, 0, 0.8], [irradiance] * 3, 0.15))
    np.testing.assert_allclose(residual.radiance, 0.25, rtol=1e-5)


def test_the_glow_of_a_sun_is_not_looked_for_in_the_sky():
    # The sun is one cell; a third of its light glows around it, within 4°, and belongs to it.
    sun = np.array([0.6, 0.5, 0.62]) / np.linalg.norm([0.6, 0.5, 0.62])
    cosine = cell_directions(256) @ sun
    glow = np.where(cosine > np.cos(np.radians(4)), 300 * np.exp((cosine - 1) / 5e-4), 0.0)
    above = glow + np.where(cosine == cosine.max(), 6e3, 0.0)
    weights = np.repeat(solid_angles(256)[:, None], 512, axis=1)
    light = one_light(sun, [(weights * above).sum()] * 3, 0.01)
    residual, _ = remove_lights(environment(1.0 + above), light)
    np.testing.assert_allclose(residual.radiance, 1.0, rtol=1e-3)


def test_each_channel_is_cut_at_its_own_level():
    # One cell of solid angle Ω; Ω × (3, 2, 0) of its (5, 5, 5) are taken.
    radiance = np.zeros((HEIGHT, 2 * HEIGHT, 3))
    radiance[10, 20] = 5.0
    share = solid_angles(HEIGHT)[10]
    light = one_light(cell_directions(HEIGHT)[10, 20], [3 * share, 2 * share, 0.0], 0.0)
    residual, removed = remove_lights(environment(radiance), light)
    np.testing.assert_allclose(residual.radiance[10, 20], [2, 3, 5], rtol=1e-6)
    np.testing.assert_allclose(removed[0], light.irradiance[0], rtol=1e-6)


def test_only_the_brightest_of_a_cap_is_cut():
    # Three neighbours of 8, 6 and 1: a level of 5 takes 3 + 1 cells' worth.
    radiance = np.full((HEIGHT, 2 * HEIGHT), 1.0)
    row = HEIGHT // 2
    radiance[row, 20:22] = 8.0, 6.0
    irradiance = [4 * solid_angles(HEIGHT)[row]] * 3
    light = one_light(cell_directions(HEIGHT)[row, 20], irradiance, 0.1)
    residual, _ = remove_lights(environment(radiance), light)
    expected = np.minimum(radiance, 5.0)
    np.testing.assert_allclose(residual.radiance[..., 1], expected, rtol=1e-6)


@pytest.mark.parametrize("much", [1.01, 100.0])
def test_a_light_that_the_map_does_not_have_takes_what_is_there_and_says_so(much):
    dim = environment(np.full((HEIGHT, 2 * HEIGHT), 0.5))
    radius = 2 * 0.2 + 1.5 * np.pi / HEIGHT
    in_cap = cell_directions(HEIGHT)[..., 2] > np.cos(radius)
    there = 0.5 * (solid_angles(HEIGHT) @ in_cap.sum(axis=1))
    light = one_light([0, 0, 1], [much * there, 1e-3, 0.0], 0.2)
    residual, removed = remove_lights(dim, light)
    np.testing.assert_allclose(removed[0], [there, 1e-3, 0], rtol=1e-5)
    assert np.all(residual.radiance[in_cap][:, 0] == 0)
    assert np.all(residual.radiance[in_cap][:, 2] == 0.5)


def test_light_is_removed_once_where_caps_overlap():
    disc = cell_directions(HEIGHT) @ np.array([0.0, 0.6, 0.8]) > np.cos(0.1)
    before = environment(disc * 10.0)
    light = one_light([0, 0.6, 0.8], [1e3] * 3)
    twice = LightSet(
        *(np.repeat(a, 2, axis=0) for a in (light.directions, light.irradiance)), [0.1] * 2
    )
    residual, removed = remove_lights(before, twice)
    assert not residual.radiance.any()
    np.testing.assert_allclose(removed, [before.integral(), np.zeros(3)], rtol=1e-6)


@pytest.mark.parametrize("direction", [(0, 1, 0), (0, -1, 0), (0, 0, -1)])
def test_a_light_on_a_pole_or_the_seam_is_found(direction):
    near = cell_directions(HEIGHT) @ np.array(direction, float) > np.cos(0.2)
    before = environment(np.where(near, 3.0, 1.0))
    irradiance = 2.0 * (solid_angles(HEIGHT) @ near.sum(axis=1))
    residual, _ = remove_lights(before, one_light(direction, [irradiance] * 3, 0.2))
    np.testing.assert_allclose(residual.radiance, 1.0, rtol=1e-5)


def sorted_cut(radiance, weights, irradiance):
    """The level t with Σ w max(L − t, 0) = irradiance, from all cells in order."""
    order = np.argsort(-radiance)
    brightest, width = radiance[order], np.cumsum(weights[order])
    levels = (np.cumsum(brightest * weights[order]) - irradiance) / width
    is_last = levels >= np.append(brightest[1:], 0.0)
    return levels[np.argmax(is_last)] if is_last.any() else 0.0


@pytest.mark.parametrize("share", [0.0, 1e-6, 0.3, 0.999, 1.5])
def test_the_level_is_the_one_that_sorting_finds(share):
    rng = np.random.default_rng(7)
    before = environment(rng.lognormal(sigma=3.0, size=(HEIGHT, 2 * HEIGHT, 3)))
    direction, radius = np.array([0.48, 0.6, 0.64]), 0.3
    weights = solid_angles(HEIGHT)[:, None] * np.ones((1, 2 * HEIGHT))
    cap = cell_directions(HEIGHT) @ direction >= np.cos(2 * radius + 1.5 * np.pi / HEIGHT)
    inside = before.radiance[cap].astype(np.float64)
    irradiance = share * weights[cap] @ inside
    levels = [sorted_cut(inside[:, c], weights[cap], irradiance[c]) for c in range(3)]
    after, _ = remove_lights(before, one_light(direction, irradiance, radius))
    np.testing.assert_allclose(after.radiance[cap], np.minimum(inside, levels), rtol=1e-5)
    np.testing.assert_array_equal(after.radiance[~cap], before.radiance[~cap])
