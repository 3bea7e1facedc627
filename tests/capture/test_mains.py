"""Mains flicker: found in simulated lamps of known frequency, and nowhere else."""

import numpy as np
import pytest

from capture.frame import Bracket, Exposure, Frame
from capture.mains import BRACKETS_NEEDED, MainsWatch, band_levels, mains_frequency_hz
from capture.sensor import Sensor, assumed_sensor

LINEAR = Sensor(0.0, 65535.0)
BANDS = 16
INTERVAL_S = 0.137
"""Between brackets: 100 and 120 Hz come to 0.3 and 0.44 of a turn, slow drifts of neither."""


def timestamps_s(count=BRACKETS_NEEDED, interval_s=INTERVAL_S, jitter_s=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return np.arange(count) * interval_s + rng.normal(0.0, jitter_s, count) + 1000.0


def lamp_levels(times_s, mains_hz, depth, readout_s=0.02, noise=0.001, seed=1):
    """Levels of bands that a rolling shutter reads one after another, under a pulsing lamp."""
    rows_s = np.linspace(0.0, readout_s, BANDS)
    pulse = np.cos(2.0 * np.pi * 2.0 * mains_hz * (times_s[:, None] + rows_s))
    clean = 0.2 * (1.0 + depth * pulse)
    return clean * np.random.default_rng(seed).normal(1.0, noise, clean.shape)


@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
@pytest.mark.parametrize("jitter_s", [0.0, 0.001])
def test_the_frequency_is_found_with_a_jitter_of_a_millisecond(mains_hz, jitter_s):
    exact_s = timestamps_s()
    levels = lamp_levels(exact_s, mains_hz, depth=0.2)
    stamped_s = timestamps_s(jitter_s=jitter_s)
    assert mains_frequency_hz(stamped_s, levels) == mains_hz


@pytest.mark.parametrize("readout_s", [0.0, 0.03])
def test_global_and_rolling_shutters_are_alike(readout_s):
    times_s = timestamps_s()
    levels = lamp_levels(times_s, 50.0, depth=0.05, readout_s=readout_s)
    assert mains_frequency_hz(times_s, levels) == 50.0


def test_one_bracket_too_few_tells_nothing():
    times_s = timestamps_s(BRACKETS_NEEDED - 1)
    assert mains_frequency_hz(times_s, lamp_levels(times_s, 50.0, depth=0.5)) is None


def test_what_is_no_lamp_is_not_taken_for_one():
    times_s = timestamps_s()
    rng = np.random.default_rng(3)
    still = rng.normal(1.0, 0.003, (len(times_s), BANDS))
    cloud = np.exp(-0.5 * np.tanh((times_s - times_s[10])[:, None])) * still
    steps = np.where(np.arange(len(times_s))[:, None] < 12, 1.0, 1.4) * still
    walker = 1.0 + 0.2 * rng.random((len(times_s), BANDS))
    for levels in (still, cloud, steps, walker, np.zeros_like(still)):
        assert mains_frequency_hz(times_s, levels) is None
    for seed in range(50):  # light that wavers as a whole, which a sinusoid explains now and then
        whole = np.random.default_rng(seed).normal(1.0, 0.05, (len(times_s), 1))
        assert mains_frequency_hz(times_s, whole * still) is None


def test_in_step_with_the_pulses_a_cloud_is_still_no_lamp():
    times_s = timestamps_s(interval_s=0.2001)  # 100 Hz · 0.2001 s: a hundredth of a turn
    cloud = np.exp(-0.3 * np.linspace(0, 1, len(times_s)) ** 2)[:, None] * np.ones(BANDS)
    assert mains_frequency_hz(times_s, cloud) is None


def test_levels_are_means_of_rows():
    counts = np.zeros((32, 40, 3), np.uint16)
    counts[2:4] = 13107  # a fifth of white, the second of sixteen bands
    levels = band_levels(Frame(counts, Exposure(0.01)), LINEAR)
    assert levels == pytest.approx([0.0, 0.2] + [0.0] * 14)
    assert band_levels(Frame(counts[:3], Exposure(0.01)), LINEAR) == pytest.approx([0, 0, 0.2])


def test_the_watch_finds_the_lamp_in_the_shortest_exposure_and_remembers():
    watch, sensor = MainsWatch(), assumed_sensor(np.uint8)

    def bracket(number, time_s=0.002, depth=0.3):
        stamp_s = number * INTERVAL_S
        level = 120 * (1.0 + depth * np.cos(2.0 * np.pi * 100.0 * stamp_s))
        short = Frame(np.full((8, 8, 3), level, np.uint8), Exposure(time_s), stamp_s)
        long = Frame(np.full((8, 8, 3), 200, np.uint8), Exposure(0.02), stamp_s + 0.03)
        return Bracket((long, short))

    found = [watch.look_at(bracket(number), sensor) for number in range(BRACKETS_NEEDED)]
    assert found == [0.0] * (BRACKETS_NEEDED - 1) + [50.0]
    for number in range(2 * BRACKETS_NEEDED):  # as the exposures that it leads to show it
        assert watch.look_at(bracket(99 + number, depth=0.0), sensor) == 50.0


def test_the_watch_compares_equal_exposures_only():
    watch, sensor = MainsWatch(), assumed_sensor(np.uint8)
    for number in range(2 * BRACKETS_NEEDED):
        stamp_s = number * INTERVAL_S
        level = 120 * (1.0 + 0.3 * np.cos(2.0 * np.pi * 100.0 * stamp_s))
        exposure = Exposure(0.002 if number % BRACKETS_NEEDED else 0.003)
        frame = Frame(np.full((8, 8, 3), level, np.uint8), exposure, stamp_s)
        assert watch.look_at(Bracket((frame,)), sensor) == 0.0
