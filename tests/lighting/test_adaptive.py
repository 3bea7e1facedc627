"""The adaptive method as a whole: what it holds on to from frame to frame, and what it gives up."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.blocks.block_grid import block_grid
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.summed_area import block_sums
from lighting.methods.adaptive import SAFETY, adaptive, adaptive_next, block_rows
from lighting.reduce import reduce_next, reduce_to_lights
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions
from tests.environments import (
    bright_poles,
    constant,
    environment,
    one_hot,
    outdoors,
    sun_in_sky,
    turned,
    two_cells,
)

MAPS = {
    "outdoors": outdoors(32),
    "constant": constant(),
    "bright poles": bright_poles(),
    "one cell": one_hot(),
    "two cells": two_cells(),
    "sun": sun_in_sky(),
    "smallest": constant(2),
    "one channel": environment(np.ones((8, 16, 3)) * (0.0, 0.0, 1.0)),
    "rows of no power of two": outdoors(50),
}
each_map = pytest.mark.parametrize("view", MAPS.values(), ids=MAPS)


def noisy(view, noise, seed):
    factor = 1 + noise * np.random.default_rng(seed).standard_normal(view.radiance.shape)
    return environment(view.radiance * factor.clip(0))


def follow(views, count=64, error=None):
    """Return the lights of each view, with the memory of those before."""
    sets, memory = [], None
    for view in views:
        lights, memory = reduce_next(view, count, memory=memory, error=error)
        sets.append(lights)
    return sets


@each_map
@pytest.mark.parametrize("count", [1, 5, 64])
def test_the_memory_of_the_same_map_changes_nothing(view, count):
    # Not in turns in which another fill is tried, and found better.
    first, *others = follow([view] * 4, count)
    for lights in others:
        for name in ("irradiance", "angular_radius_rad", "directions", "fill"):
            own, expected = getattr(lights, name), getattr(first, name)
            order, other = np.lexsort(lights.directions.T), np.lexsort(first.directions.T)
            if name != "fill":
                own, expected = own[order], expected[other]
            np.testing.assert_allclose(
                own, expected, rtol=1e-9, atol=1e-9 * abs(expected).max(initial=0)
            )


@each_map
def test_all_light_is_held_with_memory_too(view):
    views = [noisy(view, 0.05, seed) for seed in range(6)]
    for seen, lights in zip(views, follow(views, 12), strict=True):
        np.testing.assert_allclose(lights.integral(), seen.integral(), rtol=1e-6)
        assert (harmonics.lowest(lights.fill) >= -1e-9 * (1e-30 + lights.fill[0])).all()
        assert len(lights) <= 12


@pytest.mark.parametrize("height", [32, 64, 200, 300])
def test_noise_moves_no_light_but_key_lights(height):
    # The rows of the cells are 32, 64, 50 and 60 of these maps.
    sets = follow([noisy(outdoors(height), 0.01, seed) for seed in range(6)])
    # In any order: that in which cells are cut is that of their importance.
    others = [{tuple(d) for d in lights.directions[~lights.is_key]} for lights in sets]
    assert all(other == others[0] for other in others)
    # Without memory it does, so this would notice a memory that does nothing.
    alone = reduce_to_lights(noisy(outdoors(height), 0.01, 5), 64)
    assert len({tuple(d) for d in alone.directions} & others[0]) < 10


@pytest.mark.parametrize("count", [40, 63, 65, 200, 300])
def test_memory_of_another_count_is_safe(count):
    _, memory = reduce_next(outdoors(128), 64)
    lights, _ = reduce_next(outdoors(128), count, memory=memory)
    assert len(lights) <= count
    np.testing.assert_allclose(lights.integral(), outdoors(128).integral(), rtol=1e-6)


@pytest.mark.parametrize("height", [16, 31, 100, 257])
def test_memory_of_another_map_is_safe(height):
    _, memory = reduce_next(outdoors(64), 64)
    lights, _ = reduce_next(outdoors(height), 64, memory=memory)
    np.testing.assert_allclose(lights.integral(), outdoors(height).integral(), rtol=1e-6)


def test_after_a_dark_frame_it_starts_anew():
    dark = environment(np.zeros((32, 64)))
    before, nothing, after = follow([outdoors(32), dark, outdoors(32)], 20)
    assert len(nothing) == 0
    np.testing.assert_array_equal(after.directions, before.directions)


@settings(deadline=None, max_examples=8)
@given(columns=st.integers(0, 255), seed=st.integers(0, 99))
def test_a_key_light_turns_with_the_map(columns, seed):
    direction = np.random.default_rng(seed).standard_normal(3)
    direction /= np.linalg.norm(direction)
    cosine = cell_directions(128) @ direction
    view = environment(0.1 + 9000 * (cosine > np.cos(0.02)) + 0.05 * cosine)
    lights, rolled = (reduce_to_lights(v, 16) for v in (view, turned(view, columns)))
    assert lights.is_key.sum() == rolled.is_key.sum() == 1
    angle = -np.pi * columns / 128
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    np.testing.assert_allclose(rolled.directions[0], turn @ lights.directions[0], atol=1e-9)
    np.testing.assert_allclose(rolled.irradiance[0], lights.irradiance[0], rtol=1e-6)


def test_a_map_of_one_colour_needs_no_light():
    lights = reduce_to_lights(constant(64), 64)
    assert len(lights) == 0
    assert not lights.fill[1:].any()
    np.testing.assert_allclose(lights.fill[0] * np.sqrt(1 / (4 * np.pi)), 1, rtol=1e-6)


@pytest.mark.parametrize("error", [0.02, 0.05, 0.1, 0.3])
def test_no_fewer_lights_are_predicted_to_meet_an_error(error):
    # A fixed count has its own choice of the fill and of key lights: a light more or less apart.
    view = outdoors(128)
    lights = reduce_to_lights(view, 512, error=error)
    assert lights.predicted_error <= error / SAFETY
    fewer = reduce_to_lights(view, max(len(lights) * 3 // 4, 1))
    assert fewer.predicted_error > error / SAFETY or len(lights) <= 2


def test_the_smaller_the_error_the_more_lights():
    numbers = [len(reduce_to_lights(outdoors(64), 512, error=e)) for e in (0.3, 0.1, 0.05, 0.02)]
    assert numbers == sorted(numbers)
    assert numbers[0] < numbers[-1]


def test_there_are_no_more_lights_than_allowed():
    lights = reduce_to_lights(outdoors(64), 10, error=0.001)
    assert len(lights) == 10
    assert lights.predicted_error > 0.001


@pytest.mark.parametrize("error", [0.03, 0.08])
def test_the_number_does_not_waver_under_noise(error):
    numbers = [
        len(s) for s in follow([noisy(outdoors(64), 0.01, s) for s in range(16)], 512, error)
    ]
    changes = np.count_nonzero(np.diff(numbers))
    assert changes <= 1  # the first choice, for one map alone, may turn out too small


def test_the_number_follows_a_slow_sky_without_wavering():
    cosine = cell_directions(64) @ np.array([0.6, 0.64, 0.48])
    phase = np.linspace(0, 2 * np.pi, 40)
    lamp = np.exp(40 * (cosine - 1))
    views = [environment(0.5 + (1 - np.cos(p)) * 8 * lamp) for p in phase]
    numbers = np.array([len(lights) for lights in follow(views, 512, 0.05)])
    steps = np.sign(np.diff(numbers))
    steps = steps[steps != 0]
    assert numbers.max() > numbers[0]
    # Once up and once down would be 1; another fill may make one detour each way.
    assert np.count_nonzero(np.diff(steps)) <= 4


def test_blocks_and_maps_give_the_same_lights():
    view = outdoors(128)
    none = np.zeros((128, 256))
    sums = BlockSums(block_sums(view.radiance), none, none)
    lights, _ = reduce_next(view, 64)
    of_blocks, _ = reduce_next(sums, 64)
    np.testing.assert_allclose(of_blocks.directions, lights.directions, atol=1e-12)
    np.testing.assert_allclose(of_blocks.irradiance, lights.irradiance, rtol=1e-9)


@pytest.mark.parametrize("count", [64, 65])
def test_more_rows_of_blocks_than_are_used_change_nothing(count):
    # Noise, so that no two cuts are alike: sums in another order round otherwise.
    clean = outdoors(512).radiance
    noise = np.random.default_rng(8).uniform(0.95, 1.05, clean.shape)
    view = environment(clean * noise)
    rows = block_rows(count, None)
    whole = adaptive_next(block_sums(view.radiance, 512), block_grid(512, 512), count)[0]
    few = adaptive(view, count)
    assert rows < 512
    np.testing.assert_allclose(whole.directions, few.directions, atol=1e-9)
    assert whole.predicted_error == pytest.approx(few.predicted_error, rel=1e-9)
