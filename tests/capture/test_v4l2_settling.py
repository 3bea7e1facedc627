"""The measured delay holds the true one, whatever it is, and widens where it varies."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import CameraLost, CameraStalled, InputError, UnreadableFrame
from capture.v4l2.settling import Settling, measure_settling
from capture.v4l2.stream import Delivery
from tests.capture.simulated_camera import SimulatedCamera

EXTREMES_S = (0.0001, 0.0333)


def measure(camera: SimulatedCamera) -> Settling:
    return measure_settling(camera, camera.set_exposure, camera.level, EXTREMES_S)


@settings(max_examples=15, deadline=None)
@given(
    delay_frames=st.floats(0.3, 5.0),
    interval_s=st.sampled_from([1 / 120, 1 / 30, 1 / 5]),
    seed=st.integers(0, 1000),
)
def test_a_constant_delay_is_found_to_a_third_of_a_frame(
    delay_frames: float, interval_s: float, seed: int
) -> None:
    camera = SimulatedCamera(
        interval_s=interval_s, delay_s=delay_frames * interval_s, setting_s=0.0005, seed=seed
    )
    settling = measure(camera)
    # Settings count from any moment of the time that they take.
    earliest_s, latest_s = camera.delay_s - camera.setting_s, camera.delay_s
    assert settling.earliest_s <= earliest_s
    assert latest_s <= settling.latest_s
    assert settling.latest_s - settling.earliest_s < 0.33 * interval_s + camera.setting_s
    assert settling.frame_interval_s == pytest.approx(interval_s)
    assert settling.setting_s == pytest.approx(camera.setting_s)


def test_a_delay_that_varies_by_a_frame_is_bounded_by_all_that_was_seen() -> None:
    steady, wandering = (measure(SimulatedCamera(wander_s=wander_s)) for wander_s in (0.0, 0.025))
    assert wandering.earliest_s < 0.08 - 0.025
    assert wandering.latest_s > 0.08 + 0.025
    assert wandering.doubt_s > 2 * steady.doubt_s


def test_stamps_that_are_late_do_not_change_the_interval() -> None:
    intervals_s = [
        measure(SimulatedCamera(jitter_s=0.01, seed=seed)).frame_interval_s for seed in range(5)
    ]
    assert intervals_s == pytest.approx([1 / 30] * 5, rel=0.01)


def test_damaged_frames_are_not_looked_at() -> None:
    damaged = set(range(0, 200, 3))
    camera = SimulatedCamera(damaged=damaged)
    seen = []

    def level(data: bytes) -> float:
        seen.append(data)
        return camera.level(data)

    settling = measure_settling(camera, camera.set_exposure, level, EXTREMES_S)
    assert settling.earliest_s < 0.08 < settling.latest_s
    assert not {SimulatedCamera.number_of(data) for data in seen} & damaged


def test_frames_that_cannot_be_read_are_left_out_and_too_many_told() -> None:
    camera = SimulatedCamera()

    def level(data: bytes) -> float:
        if SimulatedCamera.number_of(data) % 4 == 1:
            raise UnreadableFrame("breaks off")
        return camera.level(data)

    settling = measure_settling(camera, camera.set_exposure, level, EXTREMES_S)
    assert settling.earliest_s < 0.08 < settling.latest_s
    with pytest.raises(CameraStalled, match="40 damaged frames one after the other"):
        measure(SimulatedCamera(damaged=set(range(30, 300))))


def test_a_covered_lens_is_refused() -> None:
    camera = SimulatedCamera()
    with pytest.raises(InputError, match="is the lens covered"):
        measure_settling(camera, camera.set_exposure, lambda data: 16.0, EXTREMES_S)


def test_a_camera_that_stops_following_is_refused() -> None:
    """Its level steps once, for the levels to be told apart, and then no more."""
    camera = SimulatedCamera(delay_s=0.05)
    sets = []

    def set_exposure(time_s: float) -> float:
        sets.append(time_s)
        return camera.set_exposure(time_s) if len(sets) <= 2 else time_s

    with pytest.raises(InputError, match="does not follow its exposure control"):
        measure_settling(camera, set_exposure, camera.level, EXTREMES_S)


@pytest.mark.parametrize("shift_s", [-1.8e9, 3.0])
def test_stamps_of_another_clock_are_refused(shift_s: float) -> None:
    class Shifted(SimulatedCamera):
        def next_frame(self, timeout_s: float) -> Delivery | None:
            delivery = super().next_frame(timeout_s)
            assert delivery is not None
            return replace(delivery, timestamp_s=delivery.timestamp_s + shift_s)

    with pytest.raises(InputError, match="another clock"):
        measure(Shifted())


def test_silence_and_unplugging_are_told_apart() -> None:
    with pytest.raises(CameraStalled, match="no frame within 10 s"):
        measure(SimulatedCamera(silent_s=1000.5))
    with pytest.raises(CameraLost):
        measure(SimulatedCamera(unplugged_s=1000.5))
