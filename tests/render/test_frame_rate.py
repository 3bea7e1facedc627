"""A frame rate is held on machines of any speed, told by a clock that is not one."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from lighting.stream.budget import FRAMES, next_count
from lighting.stream.light_stream import LightPlan, StreamMemory
from render.frame_rate import FEWEST_LIGHTS, STEPS, FrameRate

FULL_PX = (640, 480)
PERIOD_MS = 1e3 / 30
PLAN = LightPlan(64)


def session(picture_ms, frames, before_ms=5.0, light_ms=0.02):
    """Return the width of each picture, its lights, and what the frame took.

    `picture_ms` is told the share of the pixels, the lights and the frame.
    """
    rate, memory, lights_ms = FrameRate(30.0), StreamMemory(None, None, 32, 32), []
    widths, counts, times_ms = [], [], []
    for frame in range(frames):
        plan = rate.planned(PLAN)
        most = next_count(memory.most, memory.found, lights_ms, plan.budget_ms, plan.fewest)
        most = min(most, plan.count)
        lights_ms = lights_ms if most == memory.most else []
        memory = StreamMemory(None, None, most, most)
        size_px = rate.size_px(FULL_PX)
        drawn_ms = picture_ms(math.prod(size_px) / math.prod(FULL_PX), most, frame)
        stages = {"decode": 99.0, "merge": before_ms, "lights": light_ms * most, "write": 99.0}
        rate.judge({**stages, "render": drawn_ms}, plan, memory)
        lights_ms = [*lights_ms, light_ms * most + drawn_ms][-FRAMES:]
        widths.append(size_px[0])
        counts.append(most)
        times_ms.append(before_ms + light_ms * most + drawn_ms)
    return np.array(widths), np.array(counts), np.array(times_ms)


def test_where_there_is_time_all_is_drawn():
    widths, counts, _ = session(lambda share, count, _: 10 * share + 0.1 * count, 60)
    assert (widths == 640).all()
    assert counts[-1] == 64


def test_lights_go_first_and_the_picture_stays_where_that_is_enough():
    widths, counts, times_ms = session(lambda share, count, _: 8 * share + 0.6 * count, 80)
    assert (widths == 640).all()
    assert FEWEST_LIGHTS <= counts[-1] < 64
    assert times_ms[-1] <= PERIOD_MS


def test_then_the_picture_becomes_smaller_by_steps_that_are_hardly_seen():
    widths, _, times_ms = session(lambda share, _count, _frame: 100 * share, 150)
    assert times_ms[-1] <= PERIOD_MS
    assert (widths[1:] >= 0.7 * widths[:-1]).all()
    assert (widths[-60:] == widths[-1]).all()
    assert widths[-1] >= 640 * math.sqrt(0.2), "not smaller than is needed"


@settings(deadline=None, max_examples=40)
@given(
    fixed_ms=st.floats(0, 60),
    pixel_ms=st.floats(0.1, 500),
    light_ms=st.floats(0, 2),
    before_ms=st.floats(0, 40),
)
def test_it_settles_and_fits_if_anything_does(fixed_ms, pixel_ms, light_ms, before_ms):
    widths, counts, times_ms = session(
        lambda share, count, _: fixed_ms + (pixel_ms + light_ms * count) * share, 400, before_ms
    )
    assert (widths[-150:] == widths[-1]).all()
    assert (counts[-150:] == counts[-1]).all()
    fits = times_ms[-1] <= PERIOD_MS
    share = (widths[-1] / 640) ** 2
    drawn_ms = fixed_ms + (pixel_ms + light_ms * counts[-1]) * share
    is_least = widths[-1] == round(640 * 2 ** (-STEPS / 4)) or drawn_ms <= 0.25 * PERIOD_MS * 1.02
    assert fits or (is_least and counts[-1] == FEWEST_LIGHTS)
    # Down until it fits, then up: one turn.
    turns = np.sign(np.diff(widths))
    assert (np.diff(turns[turns != 0]) >= 0).all()


def test_a_machine_that_is_slow_for_a_while_gets_its_picture_back():
    widths, counts, times_ms = session(
        lambda share, _count, frame: (120 if 100 <= frame < 200 else 12) * share, 500
    )
    assert (widths[:100] == 640).all()
    assert (times_ms[150:200] <= PERIOD_MS).all()
    assert widths[-1] == 640
    assert counts[-1] == 64


def test_a_slow_frame_now_and_then_changes_nothing():
    widths, _, _ = session(
        lambda share, _count, frame: (300 if frame % 5 == 4 else 15) * share, 200
    )
    assert (widths == 640).all()


@pytest.mark.parametrize("spread", [0.1, 0.2])
def test_noise_changes_the_picture_rarely(spread):
    noise = 1 + spread * np.random.default_rng(3).standard_normal(1000)
    widths, _, times_ms = session(lambda share, _, frame: 90 * share * noise[frame], 1000)
    assert np.count_nonzero(np.diff(widths[100:])) <= 2
    assert np.median(times_ms[100:]) <= PERIOD_MS


def test_without_a_rate_nothing_is_limited():
    rate = FrameRate(None)
    assert rate.planned(PLAN) is PLAN
    rate.judge({"lights": 1e6, "render": 1e6}, PLAN, StreamMemory(None, None, 64, 64))
    assert rate.size_px(FULL_PX) == FULL_PX


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf])
def test_a_rate_that_is_none_is_refused(rate_hz):
    with pytest.raises(InputError, match="a frame rate must be a number above 0"):
        FrameRate(rate_hz)
