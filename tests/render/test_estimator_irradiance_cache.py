"""Irradiance that is interpolated: the records against a plain sum over the sky, and its slopes."""

import numpy as np
import pytest
from numba import njit

from lighting.maps.environment import LUMINANCE_WEIGHTS, luminance
from lighting.sphere.latlong import cell_directions
from render.estimators.irradiance_cache import PEAK, filled, irradiance_cache, split
from render.estimators.irradiance_records import (
    FIELDS,
    IRRADIANCE,
    MOVED,
    RADIUS,
    TURNED,
    fit,
)
from render.estimators.map_tables import map_tables
from render.reference.accumulation import nothing_yet
from render.reference.checkpoint import read_checkpoint, write_checkpoint
from render.reference.surfaces import F90, FACE_NORMAL, HIT, MATT, NORMAL, ORIGIN, TO_EYE
from tests.render import estimator_scene

RINGS = 40


@njit
def fits(record, surface):
    return fit(record, surface, 0)


def smooth_map(rows=16):
    toward = cell_directions(rows)
    x, y, z = np.moveaxis(toward, -1, 0)
    return estimator_scene.environment((1 + 0.5 * y + 0.4 * x * z)[..., None] * [1.0, 0.8, 0.5])


def level(place=(0.5, 0.0, -0.3), normal=(0.0, 1.0, 0.0)):
    """Return a packet whose first surface is matt, white and at that place."""
    surface = np.zeros((21, 16), np.float32)
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    for rows, value in (
        (ORIGIN, place), (NORMAL, normal), (FACE_NORMAL, normal), (TO_EYE, normal),
        (MATT, [1 / np.pi] * 3),
    ):  # fmt: skip
        surface[rows : rows + 3, 0] = value
    surface[HIT, 0] = surface[HIT - 1, 0] = 1
    return surface


def received(surface):
    """Return the irradiance of the first surface of a packet, (3,), by a plain sum."""
    base = np.array(estimator_scene.MATERIALS[0].base_colour)
    return np.pi * estimator_scene.brute_force(smooth_map(), surface)[:, 0] / base


@pytest.fixture(scope="module")
def record():
    with estimator_scene.occluders() as held:
        shadows = estimator_scene.setting(smooth_map(), held).shadows
        tables = map_tables(smooth_map())
        [record] = filled(shadows, tables, RINGS, level()[None], 1, np.zeros((0, FIELDS)))
    return record


def test_a_record_holds_the_irradiance(record):
    np.testing.assert_allclose(record[IRRADIANCE : IRRADIANCE + 3], received(level()), rtol=0.01)
    assert record[RADIUS] == pytest.approx(0.6, abs=0.02)  # the box is so high above


def test_a_record_tells_what_turning_changes(record):
    for axis in np.eye(3)[[0, 2]]:
        turned = [
            received(level(normal=np.array([0.0, 1.0, 0.0]) + side * np.cross(axis, [0, 1, 0])))
            for side in (0.05, -0.05)
        ]
        slope = (turned[0] - turned[1]) / 0.1
        told = record[TURNED : TURNED + 9].reshape(3, 3) @ axis
        np.testing.assert_allclose(told, slope, atol=0.03 * received(level()).max())


def test_a_record_tells_what_moving_changes(record):
    place = np.array([0.5, 0.0, -0.3])
    for axis in np.eye(3)[[0, 2]]:
        moved = [received(level(place=place + side * axis)) for side in (0.1, -0.1)]
        slope = (moved[0] - moved[1]) / 0.2
        told = record[MOVED : MOVED + 9].reshape(3, 3) @ axis
        np.testing.assert_allclose(told, slope, atol=0.1 * np.abs(slope).max() + 0.05)


def test_a_record_fits_where_it_was_made_and_nowhere_far(record):
    assert fits(record, level()) > 1e3
    assert fits(record, level(place=(0.5 + record[RADIUS], 0.0, -0.3))) == pytest.approx(
        1, rel=0.01
    )
    assert fits(record, level(normal=(0, -1, 0))) < 1
    assert fits(record, level(place=(0.5, -0.2 * record[RADIUS], -0.3))) == 0  # behind


def test_a_record_in_the_open_is_not_used_where_things_are():
    with estimator_scene.occluders() as held:
        shadows = estimator_scene.setting(smooth_map(), held).shadows
        tables = map_tables(smooth_map())
        place = level(place=(0.0, 5.0, 0.0))  # of all rays up none meets the box
        [record] = filled(shadows, tables, RINGS, place[None], 1, np.zeros((0, FIELDS)))
    away_m = np.linalg.norm(shadows.sphere[:3] - [0, 5, 0])
    assert record[RADIUS] == pytest.approx(away_m, rel=1e-5)


def test_peaks_and_the_rest_are_the_map():
    light = estimator_scene.uneven_map()
    peaks, rest = split(light)
    np.testing.assert_allclose(peaks.radiance + rest.radiance, light.radiance, rtol=1e-6)
    mean = float(light.integral() @ LUMINANCE_WEIGHTS) / (4 * np.pi)
    assert luminance(rest.radiance).max() == pytest.approx(PEAK * mean, rel=1e-5)
    assert peaks.radiance.min() >= 0
    untouched = luminance(light.radiance) <= PEAK * mean
    assert 0.5 < untouched.mean() < 1
    assert not peaks.radiance[untouched].any()


def test_records_go_on_from_a_checkpoint(tmp_path):
    rng = np.random.default_rng(4)
    passes = np.repeat(level()[None], 40, axis=0).reshape(4, 10, *level().shape)
    passes[:, :, ORIGIN, 0], passes[:, :, ORIGIN + 2, 0] = rng.uniform(-1.5, 1.5, (2, 4, 10))
    with estimator_scene.occluders() as held:

        def after(memory, numbers):
            setting = estimator_scene.setting(smooth_map(), held)._replace(memory=memory)
            estimate = irradiance_cache(setting)
            radiance = np.zeros((10, 3, 16), np.float32)
            rays = [estimate(passes[number], 64, number, radiance) for number in numbers]
            return radiance, rays

        progress = nothing_yet((4, 4))
        after(progress.memory, range(2))
        write_checkpoint(tmp_path / "p", progress, "it")
        kept = read_checkpoint(tmp_path / "p", "it").memory
        whole, again = after({}, range(4)), after(kept, range(2, 4))
        whole_after = after(progress.memory, range(2, 4))
    np.testing.assert_array_equal(again[0], whole_after[0])
    assert 0 < again[1][0] < whole[1][0]
    assert again[1] == whole[1][2:]


def test_a_floor_from_few_records_is_the_sum_over_the_sky():
    rng = np.random.default_rng(3)
    surfaces = np.repeat(level()[None], 20, axis=0)
    surfaces[:, ORIGIN, 0], surfaces[:, ORIGIN + 2, 0] = rng.uniform(-1.5, 1.5, (2, 20))
    radiance = np.zeros((20, 3, 16), np.float32)
    with estimator_scene.occluders() as held:
        estimate = irradiance_cache(estimator_scene.setting(smooth_map(), held))
        first = estimate(surfaces, 64, 0, radiance)
        again = estimate(surfaces, 64, 1, np.zeros_like(radiance))
    assert first > 0 == again  # records are kept
    known = np.array([received(surface) for surface in surfaces]) / np.pi
    off = np.sqrt(np.mean((radiance[..., 0] - known) ** 2) / np.mean(known**2))
    assert off < 0.03
    assert not radiance[..., 1:].any()
    assert not surfaces[:, F90].any()
