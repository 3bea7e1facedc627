"""A frame under another's label contradicts the bracket; cameras of any tone curve do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from capture.sensor import Sensor, assumed_sensor
from capture.v4l2.consistency import find_contradiction

SRGB = assumed_sensor(np.uint8)
TIMES_S = (0.0005, 0.004, 0.03)
SCENE = np.geomspace(0.05, 3000, 4000)


def shown(time_s: float, gamma: float = 2.2, black: float = 0.0) -> NDArray[np.uint8]:
    """Return SCENE as a camera with a power law for its tone curve shows it."""
    linear = np.clip(SCENE * time_s, 0, 1)
    return np.rint(255 * (black + (1 - black) * linear ** (1 / gamma))).astype(np.uint8)


@pytest.mark.parametrize("gamma", [1.6, 2.2, 3.0])
@pytest.mark.parametrize("black", [0.0, 0.08])
def test_brackets_of_other_tone_curves_pass(gamma: float, black: float) -> None:
    samples = [shown(time_s, gamma, black) for time_s in TIMES_S]
    assert find_contradiction(TIMES_S, samples, SRGB) is None


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0.0001, 0.03), min_size=2, max_size=6, unique=True), st.randoms())
def test_true_labels_pass_and_exchanged_ones_do_not(times_s: list[float], random) -> None:
    times_s = sorted(times_s)
    samples = [shown(time_s) for time_s in times_s]
    assert find_contradiction(times_s, samples, SRGB) is None
    if times_s[-1] > 2 * times_s[0]:
        order = [len(times_s) - 1, *range(1, len(times_s) - 1), 0]
        exchanged = [samples[index] for index in order]
        assert find_contradiction(times_s, exchanged, SRGB) is not None


@pytest.mark.parametrize("wrong", [0, 1, 2])
@pytest.mark.parametrize("shown_as", [0, 1, 2])
def test_one_frame_with_another_ones_exposure_is_found(wrong: int, shown_as: int) -> None:
    samples = [shown(time_s) for time_s in TIMES_S]
    samples[wrong] = samples[shown_as]
    found = find_contradiction(TIMES_S, samples, SRGB)
    assert (found is None) == (wrong == shown_as)


def test_a_frame_that_is_far_too_bright_is_found() -> None:
    assert find_contradiction((0.0005, 0.004), [shown(0.0005), shown(0.03)], SRGB) is not None


def test_a_cycle_that_slipped_by_a_frame_is_found() -> None:
    samples = [shown(TIMES_S[(index + 1) % 3]) for index in range(3)]
    assert find_contradiction(TIMES_S, samples, SRGB) is not None


def test_light_that_changes_in_a_part_of_the_picture_passes() -> None:
    samples = [shown(time_s) for time_s in TIMES_S]
    samples[1][::3] = 200
    assert find_contradiction(TIMES_S, samples, SRGB) is None


def test_black_of_a_raw_sensor_is_no_light() -> None:
    """Black at 64 of 4095 is 0.016 of white, the same in every exposure."""
    sensor = Sensor(0.0, 4095.0)
    samples = [
        (64 + 4031 * np.clip(SCENE / 100 * time_s, 0, 1)).astype(np.uint16) for time_s in TIMES_S
    ]
    assert find_contradiction(TIMES_S, samples, sensor) is None
    assert find_contradiction(TIMES_S, samples[::-1], sensor) is not None


@pytest.mark.parametrize("level", [0, 255])
def test_pictures_all_dark_or_all_full_say_nothing(level: int) -> None:
    samples = [np.full(4000, level, np.uint8)] * 3
    assert find_contradiction(TIMES_S, samples, SRGB) is None


def test_exposures_within_a_factor_of_two_may_flicker() -> None:
    samples = [shown(0.0100), shown(0.0099)]
    assert find_contradiction((0.0100, 0.0150), samples, SRGB) is None
    assert find_contradiction((0.0100, 0.0200), samples, SRGB) is not None
