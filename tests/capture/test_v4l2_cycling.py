"""No frame under another's label, at the highest rate, whatever the camera does meanwhile."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import CameraLost, CameraStalled, UnreadableFrame
from capture.v4l2.cycling import CameraCounters, Exposed, ExposureCycle
from capture.v4l2.settling import measure_settling
from tests.capture.simulated_camera import SimulatedCamera

TIMES_S = (0.0005, 0.004, 0.03)
DELAYS_FRAMES = np.linspace(0.4, 4.4, 9)


class Run:
    """A camera whose delay is measured, and what its brackets came to."""

    def __init__(self, camera: SimulatedCamera) -> None:
        self.camera = camera
        self.counters = CameraCounters()
        settling = measure_settling(camera, camera.set_exposure, camera.level, (0.0001, 0.0333))
        self.cycle = ExposureCycle(
            camera, camera.set_exposure, camera.look, settling, self.counters
        )
        self.brackets: list[list[Exposed]] = []
        self.frames_per_bracket = 0.0

    def collect(
        self, brackets: int, times_s: tuple[float, ...] = TIMES_S, work_s: float = 0.004
    ) -> "Run":
        start_s = self.camera.time_s
        for _ in range(brackets):
            self.brackets.append(self.cycle.collect(times_s))
            self.camera.pass_time(work_s)
        passed_s = self.camera.time_s - start_s
        self.frames_per_bracket = passed_s / self.camera.interval_s / brackets
        return self

    @property
    def mislabelled(self) -> int:
        exposed = [one for bracket in self.brackets for one in bracket]
        return sum(
            one.actual_s != SimulatedCamera.exposure_of(one.delivery.data) for one in exposed
        )

    def check_counters(self) -> None:
        counted = self.counters
        assert counted.frames == sum(
            (counted.used, counted.skipped_settling, counted.surplus, counted.errors, counted.stale)
        )
        assert counted.used == sum(map(len, self.brackets))


@pytest.mark.parametrize("delay_frames", DELAYS_FRAMES)
@pytest.mark.parametrize("transfer_s", [0.001, 0.012, 0.032])
def test_a_steady_camera_gives_a_bracket_in_as_many_frames_as_exposures(
    delay_frames: float, transfer_s: float
) -> None:
    """Whenever in a frame's time a setting falls due: before, while or after one is read."""
    run = Run(SimulatedCamera(delay_s=delay_frames / 30, transfer_s=transfer_s)).collect(40)
    assert run.mislabelled == 0
    assert run.frames_per_bracket < 3 + 6 / 40  # the first one waits for the delay
    for bracket in run.brackets:
        assert sorted(one.wanted_s for one in bracket) == sorted(TIMES_S)
    run.check_counters()


def test_four_times_as_many_brackets_as_by_waiting_for_each_exposure() -> None:
    """Setting, waiting until the delay is over and taking the next frame, as is usual."""
    run = Run(SimulatedCamera()).collect(40)
    camera = SimulatedCamera()
    settling = measure_settling(camera, camera.set_exposure, camera.level, (0.0001, 0.0333))
    start_s = camera.time_s
    for _ in range(20):
        for time_s in TIMES_S:
            camera.set_exposure(time_s)
            earliest_s = camera.time_s + settling.latest_s
            while (frame := camera.next_frame(1.0)) and frame.timestamp_s < earliest_s:
                pass
    naive = (camera.time_s - start_s) / camera.interval_s / 20
    assert naive > 3.8 * run.frames_per_bracket


@settings(max_examples=25, deadline=None)
@given(
    delay_frames=st.floats(0.3, 5.0),
    setting_s=st.floats(0.0005, 0.02),
    jitter_s=st.sampled_from([0.0, 0.0002, 0.0005]),
    work_s=st.floats(0.0, 0.3),
    lost=st.sets(st.integers(100, 300), max_size=30),
    damaged=st.sets(st.integers(100, 300), max_size=30),
    seed=st.integers(0, 10_000),
)
def test_whatever_the_camera_does_no_frame_has_another_ones_label(
    delay_frames: float,
    setting_s: float,
    jitter_s: float,
    work_s: float,
    lost: set[int],
    damaged: set[int],
    seed: int,
) -> None:
    camera = SimulatedCamera(
        delay_s=delay_frames / 30,
        setting_s=setting_s,
        jitter_s=jitter_s,
        lost=lost,
        damaged=damaged,
        seed=seed,
    )
    run = Run(camera).collect(12, work_s=work_s)
    assert run.mislabelled == 0
    used = {one.delivery.sequence for bracket in run.brackets for one in bracket}
    assert not used & (lost | damaged)
    run.check_counters()


@pytest.mark.parametrize("wander_s", [0.03, 0.05])
def test_a_camera_whose_delay_varies_is_slower_but_not_wrong(wander_s: float) -> None:
    run = Run(SimulatedCamera(wander_s=wander_s, seed=2)).collect(30)
    assert run.mislabelled == 0
    assert 8 < run.frames_per_bracket < 20


def test_stamps_a_third_of_a_frame_late_on_the_average_hardly_mislead() -> None:
    """As of a machine that stands still now and then; the pixels' check is the second line."""
    runs = [Run(SimulatedCamera(jitter_s=0.01, seed=seed)).collect(20) for seed in range(10)]
    assert sum(run.mislabelled for run in runs) <= 1  # of 600
    assert np.mean([run.frames_per_bracket for run in runs]) < 9


def test_equal_exposures_take_a_frame_each() -> None:
    run = Run(SimulatedCamera()).collect(20, times_s=(0.01, 0.01, 0.001))
    assert run.mislabelled == 0
    assert run.frames_per_bracket < 3.4
    for bracket in run.brackets:
        assert len({one.delivery.sequence for one in bracket}) == 3
        assert sorted(one.wanted_s for one in bracket) == [0.001, 0.01, 0.01]


def test_an_exposure_that_stays_is_set_once() -> None:
    camera = SimulatedCamera()
    run = Run(camera)
    sets = len(camera.effects)
    run.collect(20, times_s=(0.01,))
    assert len(camera.effects) == sets + 1


@pytest.mark.parametrize("measured", [0.0, 1.0])
def test_it_does_not_matter_when_in_its_time_a_setting_counts(measured: float) -> None:
    """It may count at once while the delay is measured, and at its end later on, or conversely."""
    for delay_frames in DELAYS_FRAMES:
        camera = SimulatedCamera(delay_s=delay_frames / 30, setting_s=0.008, counts_at=measured)
        run = Run(camera)
        camera.counts_at = 1.0 - measured
        assert run.collect(10).mislabelled == 0


def test_what_the_camera_makes_of_an_exposure_is_told() -> None:
    (exposed,) = Run(SimulatedCamera()).cycle.collect([0.012345])
    assert (exposed.wanted_s, exposed.actual_s) == (0.012345, 0.0123)


def test_frames_that_waited_while_nobody_read_are_dropped_and_counted() -> None:
    run = Run(SimulatedCamera()).collect(3)
    before_s = run.camera.time_s
    run.camera.pass_time(1.0)
    run.collect(1)
    assert run.counters.stale == 6  # all that the buffers hold
    assert run.counters.gaps >= 20  # and what had no room: 30 frames less these and a few new ones
    assert run.mislabelled == 0
    newest_s = before_s + 1.0
    assert all(one.delivery.timestamp_s > newest_s - 3.1 / 30 for one in run.brackets[-1])


def test_new_exposures_are_taken_up_within_the_delay() -> None:
    run = Run(SimulatedCamera()).collect(5)
    frames = run.counters.frames
    run.collect(1, times_s=(0.002, 0.02))
    assert run.counters.frames - frames <= 3 + 2 + 2  # the delay, the two, and one of doubt each
    assert run.mislabelled == 0


def test_damaged_and_lost_frames_are_counted_and_replaced() -> None:
    run = Run(SimulatedCamera(lost=set(range(90, 160, 9)), damaged=set(range(91, 160, 7))))
    run.collect(30)
    last = max(one.delivery.sequence for one in run.brackets[-1])
    assert last > 160
    assert run.counters.gaps == len(range(90, 160, 9))
    assert run.counters.errors == len(set(range(91, 160, 7)) - set(range(90, 160, 9)))


def test_a_frame_whose_data_cannot_be_read_is_taken_again() -> None:
    camera = SimulatedCamera()
    run = Run(camera)
    unreadable = iter([True, False, True])

    def look(data: bytes):
        if next(unreadable, False):
            raise UnreadableFrame("breaks off")
        return camera.look(data)

    run.cycle._look = look
    run.collect(2)
    assert run.counters.errors == 2
    assert [len(bracket) for bracket in run.brackets] == [3, 3]
    run.check_counters()


def test_a_setting_that_was_held_up_makes_its_frame_doubtful_not_wrong() -> None:
    """Every fifth setting takes 40 ms instead of 2, and counts from any moment of that."""
    camera = SimulatedCamera()
    run = Run(camera)
    for bracket in range(30):
        camera.setting_s = 0.04 if bracket % 5 == 0 else 0.002
        run.collect(1)
    assert run.mislabelled == 0
    assert run.counters.skipped_settling > 5


def test_late_stamps_are_not_trusted() -> None:
    """A stamp half a frame late would put its frame behind a setting that it does not have."""
    camera = SimulatedCamera()
    run = Run(camera)
    camera.late = dict.fromkeys(range(130, 400, 10), 0.6 / 30)
    run.collect(60)
    assert run.mislabelled == 0
    assert run.counters.skipped_settling > 15


def test_unplugging_and_silence_end_a_bracket() -> None:
    run = Run(SimulatedCamera(unplugged_s=1006.0))
    with pytest.raises(CameraLost):
        run.collect(1000)
    assert run.camera.time_s < 1006.1
    run = Run(SimulatedCamera(silent_s=1006.0))
    with pytest.raises(CameraStalled):
        run.collect(1000)
    assert run.camera.time_s < 1006 + 2.2


def test_a_frame_rate_that_changes_is_told_not_waited_for_forever() -> None:
    """Every stamp is then unsteady."""
    run = Run(SimulatedCamera()).collect(2)
    run.camera.change_interval(1.5 / 30)
    with pytest.raises(UnreadableFrame, match="frame rate may have changed"):
        run.collect(1)
