"""The temporal stage: at rest exact, changes followed, light kept, places kept, any timestamps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.reduce import reduce_to_lights
from lighting.sphere import harmonics
from lighting.stream.mixing import MOST_FADING
from lighting.stream.temporal import steady
from tests.environments import outdoors
from tests.lighting_sets import assert_same_lights, random_set, towards

FRAME_S = 1 / 30
SEEDS = st.integers(0, 2**32 - 1)
DARK = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))


def shown(light_sets, first=None):
    """Return what is shown for each of the sets, and the last memory."""
    memory, result = first, []
    for lights in light_sets:
        lights, memory = steady(lights, memory)
        result.append(lights)
    return result, memory


def timed(light_sets, interval_s=FRAME_S):
    return [replace(each, timestamp_s=i * interval_s) for i, each in enumerate(light_sets)]


def one_light(power, angle_deg=0.0, **others):
    return LightSet(towards([angle_deg]), np.full((1, 3), power), np.zeros(1), **others)


def noisy(count, noise=0.01, power=1.0, seed=0):
    """Return sets of one light whose power wavers."""
    wavers = 1 + noise * np.random.default_rng(seed).standard_normal(count)
    return [one_light(power * each) for each in wavers]


@pytest.mark.parametrize("method", ["cells", "inverse-cdf"])
def test_what_does_not_change_is_shown_as_it_came(method):
    lights = reduce_to_lights(outdoors(16), 32, method)
    fill = harmonics.windowed(np.linspace(0, 1, 27).reshape(9, 3) + 1)
    lights = replace(lights, fill=fill, clipped_fraction=0.3, predicted_error=0.01)
    for frame in shown(timed([lights] * 8))[0]:
        for name in ("directions", "irradiance", "angular_radius_rad", "is_key", "fill"):
            assert getattr(frame, name).tobytes() == getattr(lights, name).tobytes()
        assert frame.clipped_fraction == pytest.approx(0.3)
        assert frame.predicted_error == 0.01


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_total_light_that_stays_the_same_is_kept_whatever_the_lights_do(seed):
    random = np.random.default_rng(seed)
    total = np.array([3.0, 2.0, 1.0])
    sets = []
    for lights in (random_set(random, random.choice([0, 1, 5, 12])) for _ in range(10)):
        in_lights = random.uniform(0.1, 1.0) if len(lights) else 0.0
        fill = np.zeros((9, 3))
        fill[0] = (1 - in_lights) * total / np.sqrt(4 * np.pi)
        shares = lights.irradiance / np.maximum(lights.irradiance.sum(axis=0), 1e-300)
        irradiance = shares * in_lights * total
        sets.append(replace(lights, irradiance=irradiance, fill=fill))
    for frame in shown(timed(sets))[0]:
        np.testing.assert_allclose(frame.integral(), total, rtol=1e-9)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_total_light_is_between_the_darkest_and_the_brightest_that_came(seed):
    random = np.random.default_rng(seed)
    sets = [random_set(random, random.integers(1, 12)) for _ in range(10)]
    totals = np.array([each.integral() for each in sets])
    for number, frame in enumerate(shown(timed(sets))[0]):
        so_far = totals[: number + 1]
        assert (frame.integral() >= so_far.min(axis=0) * (1 - 1e-9)).all()
        assert (frame.integral() <= so_far.max(axis=0) * (1 + 1e-9)).all()


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_the_order_of_the_lights_does_not_matter(seed):
    random = np.random.default_rng(seed)
    plain = timed([random_set(random, 8) for _ in range(6)])
    mixed = []
    for lights in plain:
        order = random.permutation(len(lights))
        fields = ("directions", "irradiance", "angular_radius_rad", "is_key")
        mixed.append(replace(lights, **{name: getattr(lights, name)[order] for name in fields}))
    for one, other in zip(shown(plain)[0], shown(mixed)[0], strict=True):
        assert_same_lights((one.directions, one.irradiance), (other.directions, other.irradiance))


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_a_light_stays_at_its_index_and_few_fade(seed):
    random = np.random.default_rng(seed)
    sets = timed([random_set(random, random.integers(1, 60)) for _ in range(8)])
    frames, _ = shown(sets)
    most = max(len(each) for each in sets)
    for came, before, after in zip(sets[1:], frames, frames[1:], strict=False):
        assert len(after) <= most + MOST_FADING
        both = min(len(before), len(after))
        lit = before.irradiance[:both].any(axis=1) & after.irradiance[:both].any(axis=1)
        cosine = (before.directions[:both] * after.directions[:both]).sum(axis=1)
        is_other = (cosine < np.cos(np.radians(10.001))) | (
            before.is_key[:both] != after.is_key[:both]
        )
        # Only the place of one that went out is given away, to one that came.
        new = {tuple(direction) for direction in came.directions}
        assert all(tuple(after.directions[i]) in new for i in np.flatnonzero(lit & is_other))


def test_two_lights_that_wander_keep_their_places():
    # The order in which they come changes in every frame, and they cross in power.
    sets = []
    for number in range(20):
        lights = LightSet(
            towards([0.2 * number, 60]), [[1 + 0.05 * number] * 3, [2 - 0.05 * number] * 3],
            np.radians([2.0, 2.0]),
        )  # fmt: skip
        order = [0, 1] if number % 2 else [1, 0]
        sets.append(
            replace(
                lights, directions=lights.directions[order], irradiance=lights.irradiance[order]
            )
        )
    for number, frame in enumerate(shown(timed(sets))[0]):
        assert len(frame) == 2
        np.testing.assert_allclose(frame.directions[0], towards([60])[0], atol=1e-12)
        lag_deg = 0.2 * number - np.degrees(np.arctan2(*frame.directions[1, :2]))
        # Of two radii, what is followed lags by at most a step over the least part, 0.12.
        assert -1e-9 <= lag_deg < 0.2 / 0.12


def test_a_switch_is_passed_in_its_own_frame_if_all_was_still():
    frames, _ = shown(timed([one_light(1.0)] * 30 + [one_light(2.0)] * 20 + [one_light(1.0)] * 2))
    assert frames[29].irradiance[0, 0] == 1.0
    assert frames[30].irradiance[0, 0] > 1.98
    assert frames[50].irradiance[0, 0] < 1.02


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS, interval_s=st.floats(0.005, 0.2))
def test_nine_tenths_of_any_change_are_shown_within_its_stated_latency(seed, interval_s):
    # Whatever came before: 1 − exp(−t/0.25 s) of what stays is shown at least.
    random = np.random.default_rng(seed)
    sets = timed([one_light(each) for each in random.uniform(0.5, 2, 20)], interval_s)
    before, memory = shown(sets)
    count = int(np.ceil(0.576 / interval_s))
    sets = [replace(one_light(1.0), timestamp_s=(20 + i) * interval_s) for i in range(count)]
    after, _ = shown(sets, memory)
    step = abs(before[-1].irradiance[0, 0] - 1)
    assert abs(after[-1].irradiance[0, 0] - 1) <= 0.1 * step + 1e-9


@pytest.mark.parametrize("change", [0.3, 2.0, 10.0], ids="×{}".format)
@pytest.mark.parametrize("seed", range(3))
def test_a_switch_in_noise_is_passed_within_two_frames(change, seed):
    # 1 % noise before and after. What is left after two more frames is a tenth of the step.
    sets = timed(noisy(30, seed=seed) + noisy(10, power=change, seed=seed + 10))
    power = [frame.irradiance[0, 0] for frame in shown(sets)[0]]
    assert abs(power[32] - change) < 0.1 * abs(change - 1)


def test_noise_is_smoothed():
    power = np.array([frame.irradiance[0, 0] for frame in shown(timed(noisy(300)))[0]])
    came = np.array([each.irradiance[0, 0] for each in noisy(300)])
    change = np.abs(np.diff(power[30:])).mean() / np.abs(np.diff(came[30:])).mean()
    assert change < 0.2  # 0.15 when written; a filter that never follows would reach 0.09
    assert abs(power[30:].mean() - 1) < 0.002


def test_a_steady_change_is_followed():
    power = np.linspace(1, 2, 31)
    sets = timed([one_light(1.0)] * 10 + [one_light(each) for each in power])
    lag = [
        each - frame.irradiance[0, 0]
        for each, frame in zip(power, shown(sets)[0][10:], strict=True)
    ]
    assert max(lag) < 0.02  # less than a frame's step
    assert max(lag[10:]) < 1e-9


def test_a_steady_change_is_followed_at_uneven_times():
    random = np.random.default_rng(0)
    times_s = np.cumsum(random.choice([0.2, 1.0, 1.0, 3.0], 60)) * FRAME_S
    sets = [replace(one_light(1 + each), timestamp_s=each) for each in times_s]
    lag = [1 + t - f.irradiance[0, 0] for t, f in zip(times_s, shown(sets)[0], strict=True)]
    assert max(lag) < 0.2
    assert max(lag[20:]) < 1e-9


def test_mains_ripple_is_smoothed():
    # 100 Hz seen 30 times a second: three frames to a period.
    ripple = 1 + 0.2 * np.sin(2 * np.pi * np.arange(90) / 3)
    power = [f.irradiance[0, 0] for f in shown(timed([one_light(each) for each in ripple]))[0]]
    assert np.ptp(power[30:]) < 0.15 * np.ptp(ripple)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_nothing_stands_in_the_dark_between_two_lamps(seed):
    random = np.random.default_rng(seed)
    lamps = towards([0, 97])
    sets = []
    for power in random.random((20, 2)) * (random.random((20, 2)) < 0.7):
        sets.append(LightSet(lamps, power[:, None] * np.ones(3), np.radians([3.0, 3.0])))
    for frame in shown(timed(sets))[0]:
        lit = frame.irradiance.any(axis=1)
        cosine = frame.directions[lit] @ lamps.T
        np.testing.assert_allclose(cosine.max(axis=1), 1, atol=1e-12)


def test_a_lamp_that_moves_is_followed():
    # 0.4° a frame, 2.5° wide: it lags until the distance in radii is the part that it is turned.
    sets = [one_light(1.0, 0.4 * i) for i in range(60)]
    sets = timed([replace(each, angular_radius_rad=np.radians([2.5])) for each in sets])
    angles = [np.degrees(np.arctan2(*frame.directions[0, :2])) for frame in shown(sets)[0]]
    lag_deg = 0.4 * np.arange(60) - angles
    # It is turned by (l + 0.4)/2.5 of the way l + 0.4 at least, which is 0.4 when l is 0.6.
    assert lag_deg.max() < 0.61
    assert lag_deg[20:].max() < 1e-9
    assert all(len(frame) == 1 for frame in shown(sets)[0])


@pytest.mark.parametrize("step_s", [0.0, -5.0, 1e-9, 1e6], ids=str)
def test_odd_timestamps_do_no_harm(step_s):
    sets = timed(noisy(40))
    odd = [
        replace(each, timestamp_s=each.timestamp_s + (step_s - FRAME_S) * (i >= 20))
        for i, each in enumerate(sets)
    ]
    frames, memory = shown(odd)
    assert memory.odd_times == (step_s <= 0)
    for frame, came in zip(frames, odd, strict=True):
        assert frame.timestamp_s == came.timestamp_s
        assert 0.97 < frame.irradiance[0, 0] < 1.03


def test_frames_that_all_have_the_same_time_are_counted_and_smoothed():
    sets = noisy(100)
    frames, memory = shown(sets)
    assert memory.odd_times == 99
    regular, _ = shown(timed(sets))
    np.testing.assert_allclose(
        [frame.irradiance[0, 0] for frame in frames],
        [frame.irradiance[0, 0] for frame in regular],
        rtol=1e-12,
    )


def test_smoothing_goes_by_time_not_by_frames():
    # A deviation that wavers evenly is halved in the same time at 30 and at 60 frames a second.
    def left_after(rate_hz):
        rest = timed([one_light(1.0)] * rate_hz, 1 / rate_hz)
        stirred = [replace(each, fill=_wavering(i)) for i, each in enumerate(rest)]
        _, memory = shown(stirred)
        later = [
            replace(one_light(1.0), timestamp_s=1 + i / rate_hz, fill=_wavering(i))
            for i in range(rate_hz // 10)
        ]
        return shown([replace(each, irradiance=np.full((1, 3), 1.01)) for each in later], memory)[0]

    slow, fast = left_after(30), left_after(60)
    left_slow, left_fast = (1.01 - each[-1].irradiance[0, 0] for each in (slow, fast))
    assert left_fast == pytest.approx(left_slow, rel=0.1)


def _wavering(number):
    """Return a fill that is up in one frame and down in the next, by much more than a step."""
    fill = np.zeros((9, 3))
    fill[0] = 3.0 if number % 2 else 1.0
    return fill


def test_a_lost_frame_is_time_that_has_passed():
    sets = timed(noisy(60))
    whole, _ = shown(sets)
    lost, _ = shown(sets[:30] + sets[45:])
    # Half a second without a frame: the next one counts for more.
    after = abs(lost[30].irradiance[0, 0] - sets[45].irradiance[0, 0])
    assert after < abs(whole[45].irradiance[0, 0] - sets[45].irradiance[0, 0])


def test_a_black_scene_lights_up_and_goes_out():
    frames, _ = shown(timed([DARK] * 3 + [one_light(1.0)] * 3 + [DARK] * 3 + [one_light(2.0)]))
    assert [len(frame) for frame in frames] == [0, 0, 0, 1, 1, 1, 0, 0, 0, 1]
    assert frames[3].irradiance[0, 0] == 1.0
    assert frames[9].irradiance[0, 0] == 2.0


def test_light_without_a_light_to_take_it_becomes_fill():
    even = np.zeros((9, 3))
    even[0] = 1.0
    overcast = replace(DARK, fill=even)
    sunny = one_light(2.0, fill=even)
    frames, _ = shown(timed([sunny] * 10 + [overcast] * 60))
    assert len(frames[10]) == 0
    totals = np.array([frame.integral()[0] for frame in frames[9:]])
    assert (np.diff(totals) <= 1e-12).all()
    np.testing.assert_allclose(frames[-1].fill, even, atol=2e-3)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS, power=st.sampled_from([1e-6, 1e-8, 1e-12]))
def test_a_fill_that_all_but_goes_out_stays_above_zero(seed, power):
    # Windowed fills are black in one direction, where rounding shows first; LightSet refuses less.
    coefficients = np.random.default_rng(seed).standard_normal((2, 9, 3))
    coefficients[:, 0] = 0.5
    bright, dim = (harmonics.windowed(each) for each in coefficients)
    sets = [replace(DARK, fill=bright)] * 20 + [replace(DARK, fill=power * dim)] * 60
    frames, _ = shown(timed(sets))
    assert frames[-1].integral()[0] < 1e-3


def test_the_clipped_share_is_that_of_the_light_shown():
    clear = one_light(1.0)
    sets = timed([clear, replace(clear, clipped_fraction=0.5)])
    frames, _ = shown(sets)
    # The same light: nothing to follow, so one frame of the slowest share, 1 − exp(−1/30/0.25).
    assert frames[1].clipped_fraction == pytest.approx(0.5 * -np.expm1(-FRAME_S / 0.25))


def test_another_scale_is_refused():
    _, memory = steady(one_light(1.0))
    with pytest.raises(InputError, match=r"lights in cd/m² cannot follow lights in relative"):
        steady(one_light(1.0, scale="cd/m²"), memory)
