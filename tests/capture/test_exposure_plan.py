"""Exposure choice: the fewest that hold a scene of known range, found soon and then kept."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from capture.exposure_plan import (
    MARGIN_EV,
    PATIENCE,
    ExposurePlan,
    first_plan,
    next_plan,
    plan_exposures,
    possible_times,
    usable_light,
)
from capture.frame import Exposure
from capture.scene_range import (
    CLIPPED_SHARE,
    DARK_LIGHT_SHARE,
    UNKNOWN_RANGE,
    SceneRange,
    scene_range,
)
from capture.sensor import Sensor
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT, record

MARGIN = 2.0**MARGIN_EV
LIGHT = (0.01, 1.0)
"""A sensor that measures from 0.01 to 1 second × radiance."""

FINE_S = possible_times((1e-5, 1.0), 1e-5)
WEBCAM_S = possible_times((1e-4, 1 / 30), 1e-4)


def test_times_are_the_cameras_steps():
    assert possible_times((1e-4, 3e-4), 1e-4) == pytest.approx([1e-4, 2e-4, 3e-4])
    assert possible_times((1e-5, 3.9e-4), 2e-4) == pytest.approx([1e-5, 2.1e-4])


def test_under_lamps_times_from_a_pulse_on_are_whole_pulses():
    times_s = possible_times((1e-3, 0.033), 1e-3, mains_hz=50.0)
    assert times_s * 1e3 == pytest.approx([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 30])
    # A pulse of 60 Hz mains is 8.33 ms; in steps of 0.1 ms the nearest are 8.3, 16.7, 25.
    long_s = [t for t in possible_times((1e-4, 0.033), 1e-4, mains_hz=60.0) if t > 0.0082]
    assert np.array(long_s) * 1e3 == pytest.approx([8.3, 16.7, 25.0])
    # A camera that can do none of them keeps its shortest.
    assert possible_times((0.012, 0.013), 1e-4, mains_hz=50.0) == pytest.approx([0.012])


def test_the_fewest_times_by_hand():
    # One exposure holds a ratio of 100; with half a stop to spare at either end, 50.
    assert plan_exposures(SceneRange(1.0, 49.0), LIGHT, FINE_S) == pytest.approx(
        (1 / 49 / MARGIN,), rel=1e-3
    )
    # 1 : 60 does not fit. Two: the shorter as long as the highlights allow; the longer so that the
    # darkest gets, 1 · t2, what the shorter gives to what just clips in the longer, t1 / t2.
    shorter_s = 1 / 60 / MARGIN
    assert plan_exposures(SceneRange(1.0, 60.0), LIGHT, FINE_S) == pytest.approx(
        (shorter_s, math.sqrt(shorter_s)), rel=2e-3
    )
    # 1 : 10^4 takes 100 / √2 from one to the next: 2, 1/2 stop short of 3. Each is as much longer
    # than the one before as the darkest gets less than full light from the longest: 20 / t3 = q.
    three = plan_exposures(SceneRange(0.05, 500.0), LIGHT, FINE_S)
    shortest_s = 1 / 500 / MARGIN
    assert three == pytest.approx(
        [shortest_s ** (1 - n / 3) * 20 ** (n / 3) for n in range(3)], rel=0.03
    )


def test_what_the_camera_cannot_do_is_left_out_at_the_ends():
    assert plan_exposures(SceneRange(1e7, 1e8), LIGHT, WEBCAM_S) == (WEBCAM_S[0],)
    assert plan_exposures(SceneRange(1e-6, 1e-5), LIGHT, WEBCAM_S) == (WEBCAM_S[-1],)
    assert plan_exposures(SceneRange(0.0, 0.0), LIGHT, WEBCAM_S) == (WEBCAM_S[-1],)


@given(
    darkest=st.floats(1e-3, 1e3),
    range_ev=st.floats(0.0, 25.0),
    step_s=st.sampled_from([1e-5, 1e-4, 3e-4]),
    mains_hz=st.sampled_from([0.0, 50.0, 60.0]),
)
@settings(max_examples=60, deadline=None)
def test_every_radiance_between_is_measured_by_one_of_them(darkest, range_ev, step_s, mains_hz):
    possible_s = possible_times((step_s, 0.1), step_s, mains_hz)
    scene = SceneRange(darkest, darkest * 2.0**range_ev)
    times_s = plan_exposures(scene, LIGHT, possible_s)
    assert set(times_s) <= set(possible_s)
    assert list(times_s) == sorted(set(times_s))
    # Of what the camera can measure at all:
    darkest_seen = max(darkest, LIGHT[0] / possible_s[-1])
    brightest_seen = min(scene.brightest, LIGHT[1] / possible_s[0])
    if darkest_seen <= brightest_seen:
        for radiance in np.geomspace(darkest_seen, brightest_seen, 50):
            light = radiance * np.array(times_s)
            assert ((light >= LIGHT[0] * 0.999) & (light <= LIGHT[1] * 1.001)).any()


def test_coarse_times_are_balanced_only_as_far_as_they_stay_the_fewest():
    # A step makes at most 10 / √2, and from 8 ms the next pulses are at 16, 24, …, 50 ms. With a
    # longest of the balanced (1 / 3)^(2/3) · 0.002^(1/3) s = 61 ms three leave a gap: it is 50,
    # the first from the 0.1 · √2 / 3 = 47 ms on that the darkest needs.
    possible_s = possible_times((0.002, 0.1), 0.002, mains_hz=60.0)
    times_s = plan_exposures(SceneRange(3.0, 1e6), (0.1, 1.0), possible_s)
    assert times_s == pytest.approx((0.002, 0.008, 0.05))


def test_a_sensor_of_noise_is_refused():
    with pytest.raises(InputError, match="--exposures"):
        usable_light(Sensor(0.0, 255.0, full_well_e=100.0))


def test_usable_light_in_closed_form():
    # Photon and read noise alone: linear value y has SNR 10 where y² = 100 (y/F + (r/F)²), so
    # y F = 50 + √(2500 + 100 r²) electrons.
    sensor = Sensor(0.0, 65535.0, full_well_e=30_000.0, read_noise_e=6.0)
    electrons = 50.0 + math.sqrt(2500.0 + 100.0 * 36.0)
    assert usable_light(sensor) == pytest.approx((electrons / 30_000.0, 0.98), rel=5e-3)


def room(rng, range_ev=13.0, lamp=0.01):
    """A picture of radiance, log-normal with a small lamp above all else; its black surround."""
    radiance = np.exp2(np.clip(rng.normal(0.0, 1.5, (60, 80)), -4.0, 4.0))
    radiance[20:23, 30:33] = lamp * 2.0**range_ev
    radiance[:, :20] = 0.0
    return np.repeat(radiance[..., None], 3, axis=2)


def captured(radiance, times_s, sensor, seed):
    exposures = [Exposure(time_s) for time_s in times_s]
    return record(radiance, exposures, sensor, np.random.default_rng(seed))


def run(radiance, sensor, possible_s, count, start=None, seed=0):
    """Return the plans of `count` brackets of one scene, the one that follows them included."""
    light = usable_light(sensor)
    plans = [start or first_plan(light, possible_s)]
    for number in range(count):
        bracket = captured(radiance, plans[-1].times_s, sensor, seed + number)
        plans.append(next_plan(plans[-1], scene_range(bracket, sensor), light, possible_s))
    return plans


def shares(radiance, times_s, light):
    """Return the true share of values that clip everywhere, and of light under the asked SNR."""
    best = radiance[..., None] * np.array(times_s)
    clips = (best > light[1]).all(axis=-1)
    dark = best.max(axis=-1) < light[0]
    return clips.mean(), radiance[dark].sum() / radiance.sum()


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["8 bit", "16 bit"])
@pytest.mark.parametrize("level", [0.3, 3.0, 300.0])
def test_no_set_of_fewer_exposures_holds_the_scene(sensor, level):
    radiance = level * room(np.random.default_rng(1))
    light = usable_light(sensor)
    possible_s = possible_times((1e-5, 1.0), 1e-5)
    times_s = run(radiance, sensor, possible_s, 2)[-1].times_s
    clipped, dark = shares(radiance, times_s, light)
    assert clipped <= CLIPPED_SHARE
    assert dark <= 1.1 * DARK_LIGHT_SHARE
    # Brute force over one exposure less: none holds the same range in steps that leave no gap.
    candidates_s = np.geomspace(possible_s[0], possible_s[-1], 60)
    for fewer in itertools.combinations(candidates_s, len(times_s) - 1):
        gaps = [b / a > light[1] / light[0] / MARGIN for a, b in itertools.pairwise(fewer)]
        short = fewer[0] * radiance.max() * MARGIN <= light[1] if fewer else False
        long = shares(radiance, fewer, light)[1] <= DARK_LIGHT_SHARE if short else False
        assert not (short and long and not any(gaps)), fewer


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["8 bit", "16 bit"])
@pytest.mark.parametrize("level", [0.01, 1.0, 1000.0])
def test_the_second_bracket_is_planned_for_the_scene(sensor, level):
    plans = run(level * room(np.random.default_rng(2)), sensor, WEBCAM_S, 6)
    assert plans[0].is_probe
    assert not plans[1].is_probe
    assert {plan.times_s for plan in plans[1:]} == {plans[1].times_s}


@pytest.mark.parametrize("start_s", [(1e-4,), (1 / 30,), (0.01, 0.02)])
@pytest.mark.parametrize("level", [0.01, 1.0, 1000.0])
def test_from_any_start_the_third_bracket_is(start_s, level):
    radiance = level * room(np.random.default_rng(3))
    possible_s = possible_times((1e-5, 1 / 30), 1e-5)
    plans = run(radiance, SRGB_8_BIT, possible_s, 8, ExposurePlan(start_s))
    assert {plan.times_s for plan in plans[2:]} == {plans[2].times_s}
    fewest = run(radiance, SRGB_8_BIT, possible_s, 1)[1].times_s
    assert plans[2].times_s == pytest.approx(fewest, rel=0.1)


@pytest.mark.parametrize("level", [3e-5, 0.1, 0.5, 2.0, 10.0, 3e4])
def test_noise_changes_nothing_in_forty_brackets(level):
    # The lowest levels stay in noise and the highest clip, whatever the camera does.
    radiance = level * room(np.random.default_rng(4))
    plans = run(radiance, SRGB_8_BIT, WEBCAM_S, 40)
    changes = sum(a.times_s != b.times_s for a, b in itertools.pairwise(plans[1:]))
    assert changes == 0


@pytest.mark.parametrize(
    ("times_s", "scene"),
    [
        ((WEBCAM_S[0], WEBCAM_S[90]), SceneRange(1.2, math.inf)),
        ((WEBCAM_S[5], WEBCAM_S[-1]), SceneRange(0.0, 900.0)),
    ],
)
def test_an_end_that_the_camera_cannot_reach_is_no_reason_to_change(times_s, scene):
    plan = ExposurePlan(times_s, is_probe=False)
    assert plan_exposures(scene, LIGHT, WEBCAM_S) != times_s
    assert next_plan(plan, scene, LIGHT, WEBCAM_S).times_s == times_s


def test_a_lamp_that_is_lit_is_held_by_the_second_bracket_after_it():
    dark, lit = (room(np.random.default_rng(5), lamp=lamp) for lamp in (1e-4, 0.03))
    before = run(dark, SRGB_8_BIT, WEBCAM_S, 3)[-1]
    assert shares(lit, before.times_s, usable_light(SRGB_8_BIT))[0] > 0
    after = run(lit, SRGB_8_BIT, WEBCAM_S, 2, before)
    assert shares(lit, after[2].times_s, usable_light(SRGB_8_BIT))[0] == 0


def test_what_is_not_needed_goes_after_patience_and_not_for_a_flash_of_dark():
    dark, lit = (room(np.random.default_rng(5), lamp=lamp) for lamp in (1e-4, 0.03))
    plan = run(lit, SRGB_8_BIT, WEBCAM_S, 2)[-1]
    waiting = run(dark, SRGB_8_BIT, WEBCAM_S, PATIENCE - 1, plan)
    assert {each.times_s for each in waiting} == {plan.times_s}
    assert run(lit, SRGB_8_BIT, WEBCAM_S, 1, waiting[-1])[-1].spare_count == 0
    assert len(run(dark, SRGB_8_BIT, WEBCAM_S, 1, waiting[-1])[-1].times_s) < len(plan.times_s)


def test_mains_that_are_found_change_the_plan_at_once():
    radiance = room(np.random.default_rng(6), lamp=1e-3)
    light = usable_light(SRGB_8_BIT)
    plan = run(radiance, SRGB_8_BIT, WEBCAM_S, 2)[-1]
    steady_s = possible_times((1e-4, 1 / 30), 1e-4, mains_hz=50.0)
    assert not set(plan.times_s) <= set(steady_s)
    scene = scene_range(captured(radiance, plan.times_s, SRGB_8_BIT, 0), SRGB_8_BIT)
    assert set(next_plan(plan, scene, light, steady_s).times_s) <= set(steady_s)


def test_the_range_of_a_bracket_is_the_scenes():
    radiance = room(np.random.default_rng(7))
    bracket = captured(radiance, (0.0005, 0.005, 0.05), LINEAR_16_BIT, 0)
    scene = scene_range(bracket, LINEAR_16_BIT)
    assert scene.brightest == pytest.approx(radiance.max(), rel=0.03)
    ordered = np.sort(radiance, axis=None)
    darkest = ordered[np.searchsorted(np.cumsum(ordered), DARK_LIGHT_SHARE * ordered.sum())]
    assert scene.darkest == pytest.approx(darkest, rel=0.1)


def test_black_and_white_frames_tell_nothing_of_one_end():
    white = captured(np.full((4, 4, 3), 1e6), (0.01,), SRGB_8_BIT, 0)
    assert scene_range(white, SRGB_8_BIT) == UNKNOWN_RANGE
    black = captured(np.zeros((40, 40, 3)), (0.01,), SRGB_8_BIT, 0)
    assert scene_range(black, SRGB_8_BIT).darkest == 0.0
    assert scene_range(black, SRGB_8_BIT).brightest < math.inf
