"""Lights of one frame after the other: what is remembered, and what a budget changes."""

from dataclasses import replace

import numpy as np
import pytest

from capture.errors import InputError
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.summed_area import block_sums
from lighting.reduce import reduce_next
from lighting.stream import temporal
from lighting.stream.budget import FIRST_COUNT, FRAMES
from lighting.stream.light_stream import LightPlan, next_lights
from tests.environments import environment, outdoors

ROWS = 32
DARK = environment(np.zeros((ROWS, 2 * ROWS)))


def noisy(count):
    """Return views of one sky, 5 % of noise on each."""
    still = outdoors(ROWS)
    random = np.random.default_rng(4)
    for _ in range(count):
        noise = np.float32(1) + 0.05 * random.standard_normal(still.radiance.shape, np.float32)
        yield replace(still, radiance=still.radiance * np.maximum(noise, 0))


def stream(views, plan, took_ms=None, interval_s=0.1):
    memory, result = None, []
    for index, view in enumerate(views):
        lights, memory = next_lights(
            view, plan, memory, took_ms=took_ms, timestamp_s=index * interval_s
        )
        result.append(lights)
    return result, memory


def assert_same(lights, expected):
    for name in ("directions", "irradiance", "angular_radius_rad", "fill", "is_key"):
        assert getattr(lights, name).tobytes() == getattr(expected, name).tobytes()
    assert lights.timestamp_s == expected.timestamp_s


@pytest.mark.parametrize("is_steady", [True, False])
@pytest.mark.parametrize("method", ["adaptive", "inverse-cdf"])
def test_every_frame_is_reduced_with_the_memory_of_the_last_and_made_steady(method, is_steady):
    views = list(noisy(5))
    found, _ = stream(views, LightPlan(20, method, is_steady=is_steady), interval_s=0.25)
    memory, shown = None, None
    for index, (view, lights) in enumerate(zip(views, found, strict=True)):
        expected, memory = reduce_next(view, 20, method, memory, timestamp_s=index * 0.25)
        if is_steady:
            expected, shown = temporal.steady(expected, shown)
        assert_same(lights, expected)


def test_a_dark_frame_between_is_dark_and_the_next_one_is_not():
    lit = outdoors(ROWS)
    lights, _ = stream([lit, DARK, lit], LightPlan(8, is_steady=False))
    assert [each.integral().any() for each in lights] == [True, False, True]


@pytest.mark.parametrize(
    "plan",
    [LightPlan(64), LightPlan(65), LightPlan(256, error=0.1), LightPlan(16, "median-cut")],
    ids=str,
)
def test_sums_over_more_blocks_than_a_plan_uses_make_no_difference_and_over_fewer_do(plan):
    view = outdoors(256).radiance * np.random.default_rng(8).uniform(0.95, 1.05, (256, 512, 1))
    view[60, 100:102] = 5000.0  # a key light, for which blocks are finest

    def lights(rows):
        sums = block_sums(view.astype(np.float32), rows)
        unseen = np.zeros(sums.shape[:2])
        return next_lights(BlockSums(sums, unseen, unseen), plan)[0]

    used, fewer = lights(plan.block_rows), lights(plan.block_rows // 2)
    np.testing.assert_allclose(lights(256).directions, used.directions, atol=1e-9)
    assert fewer.directions.shape != used.directions.shape or not np.allclose(
        fewer.directions, used.directions, atol=1e-6
    )


def test_without_a_budget_time_changes_nothing():
    views = list(noisy(6))
    slow, memory = stream(views, LightPlan(40), took_ms=1e6)
    assert memory.most == 40
    for lights, expected in zip(slow, stream(views, LightPlan(40))[0], strict=True):
        assert_same(lights, expected)


def test_a_budget_bounds_the_lights_and_never_asks_for_more_than_are_good_enough():
    views = [outdoors(ROWS)] * 8
    exact = LightPlan(512, error=1e-3, budget_ms=10.0, is_steady=False)
    # Halved after every three timed frames that are far too slow, doubled after fast ones.
    slow, _ = stream(views, exact, took_ms=100.0)
    assert [len(each) for each in slow] == [FIRST_COUNT] * 3 + [16] * 3 + [8] * 2
    fast, _ = stream(views, exact, took_ms=1.0)
    assert [len(each) for each in fast] == [FIRST_COUNT] * 3 + [64] * 3 + [128] * 2
    few, memory = stream(views, replace(exact, count=48), took_ms=1.0)
    assert [len(each) for each in few] == [FIRST_COUNT] * 3 + [48] * 5
    rough, memory = stream(views, replace(exact, error=0.2), took_ms=1.0)
    assert len(rough[-1]) < FIRST_COUNT / 2
    assert memory.most == FIRST_COUNT


@pytest.mark.parametrize(("took_ms", "after"), [(11.0, 24), (6.75, 40)])
def test_another_number_of_lights_moves_none_but_those_cut_or_put_together(took_ms, after):
    plan = LightPlan(512, error=1e-3, budget_ms=10.0, is_steady=False)
    before, changed = (
        {each.tobytes() for each in lights.directions}
        for lights in stream([outdoors(ROWS)] * (FRAMES + 1), plan, took_ms)[0][-2:]
    )
    assert (len(before), len(changed)) == (FIRST_COUNT, after)
    # Each of the 8 cuts, made or undone, has one light on one side and two on the other.
    assert len(before & changed) >= min(FIRST_COUNT, after) - 8


def test_the_time_of_frames_with_another_count_is_forgotten():
    plan = LightPlan(512, error=1e-3, budget_ms=10.0)
    memory = stream([outdoors(ROWS)] * 3, plan, took_ms=100.0)[1]
    assert memory.took_ms == (100.0, 100.0)
    _, memory = next_lights(outdoors(ROWS), plan, memory, took_ms=100.0)
    assert (memory.most, memory.took_ms) == (16, ())


@pytest.mark.parametrize("budget_ms", [0.0, -1.0, float("nan"), float("inf")])
def test_a_budget_that_is_none_is_refused(budget_ms):
    with pytest.raises(InputError, match="a budget must be above 0 ms"):
        LightPlan(error=0.1, budget_ms=budget_ms)


def test_a_budget_bounds_a_fixed_count_too_down_to_the_fewest():
    plan = LightPlan(48, budget_ms=10.0, fewest=12, is_steady=False)
    slow, _ = stream([outdoors(ROWS)] * 12, plan, took_ms=100.0)
    assert [len(each) for each in slow] == [FIRST_COUNT] * 3 + [16] * 3 + [12] * 6
    fast, _ = stream([outdoors(ROWS)] * 5, plan, took_ms=1.0)
    assert [len(each) for each in fast] == [FIRST_COUNT] * 3 + [48] * 2
