"""The number of lights there is time for, on frames that take a + b n milliseconds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.stream.budget import FIRST_COUNT, FRAMES, next_count

BUDGET_MS = 30.0
MOST = 512


def counts(time_ms, frames, first=FIRST_COUNT, wanted=MOST):
    """Return the count of each frame, all of which are drawn up to `wanted`.

    `time_ms` is told the number of lights and the frame, and returns what it took.
    """
    most, took_ms, result = first, [], []
    for frame in range(frames):
        result.append(most)
        took_ms = [*took_ms, time_ms(min(most, wanted), frame)][-FRAMES:]
        following = min(next_count(most, min(most, wanted), took_ms, BUDGET_MS), MOST)
        took_ms = took_ms if following == most else []
        most = following
    return np.array(result)


@settings(deadline=None, max_examples=60)
@given(fixed_ms=st.floats(0, 60), ms=st.floats(0.001, 60), first=st.integers(1, MOST))
def test_what_fits_once_fits_for_ever_and_settles(fixed_ms, ms, first):
    n = counts(lambda count, _: fixed_ms + ms * count, 300, first)
    fits = fixed_ms + ms * n <= BUDGET_MS
    assert (fits[1:] >= fits[:-1]).all()
    assert fits[-1] or n[-1] == 1
    assert (n[-100:] == n[-1]).all()
    # Down until it fits, then up: one turn.
    steps = np.sign(np.diff(n))
    assert (np.diff(steps[steps != 0]) >= 0).all()


@settings(deadline=None, max_examples=30)
@given(ms=st.floats(0.07, 0.7), first=st.integers(1, MOST))
def test_the_budget_is_used(ms, first):
    # 0.07 × 512 ms is more than the budget, and at 0.7 ms a light is 1/42 of it.
    used = ms * counts(lambda count, _: ms * count, 300, first)[-1] / BUDGET_MS
    assert 0.7 <= used <= 1


def test_a_slow_frame_now_and_then_changes_nothing():
    n = counts(lambda count, frame: 0.5 * count * (10 if frame % 5 == 4 else 1), 200)
    assert (n[60:] == n[60]).all()
    assert 0.7 * BUDGET_MS <= 0.5 * n[60] <= BUDGET_MS


@pytest.mark.parametrize(("noise", "largest_number"), [(0.1, 2), (0.2, 13)])
def test_noisy_timings_change_little(noise, largest_number):
    # The docstring says one change, and twelve, in this many frames.
    changes = []
    for seed in range(20):
        scatter = 1 + noise * np.random.default_rng(seed).standard_normal(1000)
        n = counts(lambda count, frame, s=scatter: (5 + 0.3 * count) * s[frame], 1000)[60:]
        changes.append(np.count_nonzero(np.diff(n)))
        assert 0.65 * BUDGET_MS < np.median(5 + 0.3 * n) < BUDGET_MS
    assert np.mean(changes) <= largest_number


def test_a_machine_that_gets_slower_is_followed_at_once_and_so_is_one_that_gets_faster():
    n = counts(lambda count, frame: 0.5 * count * (4 if 100 <= frame < 200 else 1), 300)
    assert n[99] == n[250] == pytest.approx(0.85 * 60, abs=9)
    assert 0.7 * 15 <= n[115] <= 15
    assert n[199] == n[115]


def test_where_few_lights_are_good_enough_no_large_count_waits():
    n = counts(lambda count, _: 0.01 * count, 200, wanted=10)
    assert n[-1] == FIRST_COUNT
    assert counts(lambda count, _: 0.01 * count, 200, wanted=100)[-1] <= 200


def test_no_light_at_all_is_no_reason_to_stop():
    assert next_count(8, 0, [50.0] * FRAMES, BUDGET_MS) == 1
    assert next_count(1, 0, [50.0] * FRAMES, BUDGET_MS) == 1
    assert next_count(1, 1, [0.0] * FRAMES, BUDGET_MS) == 2


def test_too_few_timings_change_nothing():
    assert next_count(64, 64, [], BUDGET_MS) == 64
    assert next_count(64, 64, [1e9, 1e9], BUDGET_MS) == 64
    assert next_count(64, 64, [1e9, 1e9, 1e9], BUDGET_MS) == 32
    # 10 % over: wait until it is certain.
    assert next_count(64, 64, [33.0] * (FRAMES - 1), BUDGET_MS) == 64
    assert next_count(64, 64, [33.0] * FRAMES, BUDGET_MS) == int(64 * 0.85 / 1.1)
