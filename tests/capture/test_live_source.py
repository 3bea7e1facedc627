"""The live source: numbered, counted, reopened within its budget, and ended when asked to."""

import threading
import time
from itertools import islice

import numpy as np
import pytest

from capture import reopening
from capture.errors import CameraLost, CameraStalled, InputError, UnreadableFrame
from capture.frame import Bracket
from capture.live_source import LiveCounters, LiveSource
from capture.reopening import MOST_OPENINGS, CameraAway, _lasting_name
from capture.v4l2.camera import CameraRequest
from render.session import Policy, run_session
from tests.capture.fake_camera import UNPLUGGED, FakePort, scene

REQUEST = CameraRequest("fake")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Milliseconds for seconds."""
    for name in ("FIRST_WAIT_S", "LONGEST_WAIT_S", "TICK_S"):
        monkeypatch.setattr(reopening, name, getattr(reopening, name) / 1000)


@pytest.fixture
def port():
    return FakePort(scene())


def live(port, **options):
    return LiveSource(REQUEST, open_camera=port.open, **options)


def taken(source, count):
    """Return `count` brackets, and the errors that came between them."""
    brackets, errors = [], []
    for item in source:
        (brackets if isinstance(item, Bracket) else errors).append(item)
        if len(brackets) == count:
            break
    return brackets, errors


def test_exposures_are_probed_and_then_chosen(port):
    with live(port) as source:
        brackets, _ = taken(source, 5)
    counts = [len(bracket.frames) for bracket in brackets]
    assert counts[0] > counts[1] == counts[-1] == 2
    assert 150 < brackets[-1].by_signal()[0].counts.max() < 250
    assert not port.cameras[0].is_open


def test_exposures_that_are_asked_for_are_kept(port):
    with live(port, exposures_s=(0.02, 0.001)) as source:
        brackets, _ = taken(source, 3)
    for bracket in brackets:
        assert [frame.exposure.time_s for frame in bracket.frames] == [0.02, 0.001]


def test_exposures_can_be_changed_on_the_way(port):
    with live(port, exposures_s=(0.02,)) as source:
        taken(source, 2)
        source.choose_exposures((0.01, 0.002))
        with pytest.raises(InputError, match="cannot expose"):
            source.choose_exposures((1.0,))
        (bracket,), _ = taken(source, 1)
        assert [frame.exposure.time_s for frame in bracket.frames] == [0.01, 0.002]
        source.choose_exposures(None)
        brackets, _ = taken(source, 3)
    assert brackets[-1].by_signal()[0].counts.max() < 250


@pytest.mark.parametrize(
    ("exposures_s", "message"),
    [((1.0,), r"cannot expose for 1 s, the nearest is 0\.0333"), ((0.001, 0.00102), "twice")],
)
def test_exposures_that_the_camera_cannot_do_are_refused_and_it_is_let_go(
    port, exposures_s, message
):
    with pytest.raises(InputError, match=message):
        live(port, exposures_s=exposures_s)
    assert not port.cameras[0].is_open


def test_lamps_on_the_mains_get_whole_pulses(port):
    port.radiance /= 30.0
    with live(port, mains_hz=50.0) as source:
        brackets, _ = taken(source, 3)
    times_s = [frame.exposure.time_s for bracket in brackets for frame in bracket.frames]
    long_s = [time_s for time_s in times_s if time_s > 0.009]
    assert long_s
    assert set(long_s) <= {0.01, 0.02, 0.03}


@pytest.mark.parametrize("fault", [UNPLUGGED, CameraStalled("no frame for 2 s")])
def test_a_camera_that_comes_back_goes_on_with_rising_numbers(port, fault):
    port.faults[3] = fault
    with live(port) as source:
        brackets, errors = taken(source, 6)
        assert source.reopened_count == 1
        assert source.counters == LiveCounters(6, 0, len(errors))
    assert [bracket.index for bracket in brackets] == list(range(6))
    indices = [frame.index for bracket in brackets for frame in bracket.frames]
    assert indices == sorted(set(indices))
    assert all(isinstance(error, CameraAway) for error in errors)
    assert [camera.is_open for camera in port.cameras] == [False, False]


def test_while_it_is_away_the_age_of_the_last_bracket_is_told(port, monkeypatch):
    monkeypatch.setattr(reopening, "FIRST_WAIT_S", 0.05)
    monkeypatch.setattr(reopening, "LONGEST_WAIT_S", 0.05)
    monkeypatch.setattr(reopening, "TICK_S", 0.01)
    port.faults[2] = UNPLUGGED
    with live(port) as source:
        port.openings_refused = [InputError("no camera fake")]
        time.sleep(0.1)  # before the first bracket: no part of its age
        started_s = time.monotonic()
        _, errors = taken(source, 3)
        took_s = time.monotonic() - started_s
    ages_s = [error.age_s for error in errors]
    assert len(ages_s) >= 6
    assert ages_s == sorted(ages_s)
    assert 0.09 < ages_s[-1] <= took_s
    assert "unplugged" in str(errors[0])
    assert "no camera fake" in str(errors[-1])


def test_a_camera_that_does_not_come_back_is_given_up(port):
    port.faults[2] = UNPLUGGED
    with live(port) as source:
        port.openings_refused = [InputError("no camera fake")] * 99
        with pytest.raises(CameraLost, match=r"given up.*5 times within 60 s.*no camera fake"):
            taken(source, 3)
    assert port.open_count == 1 + MOST_OPENINGS


def test_a_camera_that_is_lost_again_and_again_is_given_up(port):
    port.faults = dict.fromkeys(range(1, 99, 2), UNPLUGGED)
    with live(port) as source, pytest.raises(CameraLost, match="given up"):
        taken(source, 50)
    assert source.counters.brackets == 1 + MOST_OPENINGS


def test_losses_that_are_far_apart_do_not_add_up(port, monkeypatch):
    monkeypatch.setattr(reopening, "WINDOW_S", 1e-6)
    port.faults = dict.fromkeys(range(1, 40, 2), UNPLUGGED)
    with live(port) as source:
        taken(source, 20)
        assert source.reopened_count > MOST_OPENINGS


def test_a_camera_that_comes_back_to_a_darker_scene_keeps_its_white(port):
    """Formats of 16 bits do not tell it: it is judged by the counts that were seen."""
    port.faults[1] = UNPLUGGED
    with live(port) as source:
        taken(source, 3)
    first, again = port.requests
    assert first.seen_dn == 0
    assert again.seen_dn == 255


def test_another_camera_in_its_place_is_no_replacement(port):
    port.faults[1] = UNPLUGGED
    with live(port) as source:
        port.radiance = scene(height=20)
        with pytest.raises(InputError, match="came back as"):
            taken(source, 3)
    assert not port.cameras[-1].is_open


def test_a_damaged_bracket_is_told_and_does_not_end_it(port):
    port.faults[1] = UnreadableFrame("the frame's JPEG is damaged")
    with live(port) as source:
        items = list(islice(source, 3))
        assert [isinstance(item, Bracket) for item in items] == [True, False, True]
        assert source.counters == LiveCounters(2, 1, 0)
    assert port.open_count == 1


def test_stop_ends_the_iteration_and_another_one_goes_on(port):
    with live(port) as source:
        first = []
        for item in source:
            first.append(item)
            if len(first) == 3:
                source.stop()
        assert len(first) == 3
        assert next(iter(source)).index == 3


def test_stop_ends_a_wait(port, monkeypatch):
    monkeypatch.setattr(reopening, "FIRST_WAIT_S", 60.0)
    monkeypatch.setattr(reopening, "LONGEST_WAIT_S", 60.0)
    monkeypatch.setattr(reopening, "TICK_S", 30.0)
    port.faults[0] = UNPLUGGED
    with live(port) as source:
        threading.Timer(0.05, source.stop).start()
        started_s = time.monotonic()
        assert all(isinstance(item, CameraAway) for item in source)
        assert time.monotonic() - started_s < 10.0


def test_the_session_keeps_the_newest_and_counts_the_rest(port):
    port.faults = {4: UNPLUGGED, 9: UnreadableFrame("damaged")}
    seen, told = [], []
    with live(port) as source:

        def process(bracket, _clock, counters):
            seen.append(bracket.index)
            counters.rendered += 1
            time.sleep(0.005)
            if bracket.index >= 60:
                source.stop()

        counters, _ = run_session(source, process, policy=Policy.NEWEST, on_failure=told.append)
        delivered = source.counters
    assert counters.captured == counters.replaced + counters.failed + counters.rendered
    assert counters.captured == delivered.brackets + delivered.unreadable + delivered.away
    assert seen == sorted(set(seen))
    assert delivered.unreadable == source.reopened_count == 1


def test_a_camera_lost_for_good_ends_the_session_with_its_reason(port):
    port.faults[1] = UNPLUGGED
    with live(port) as source:
        port.openings_refused = [CameraLost("still unplugged")] * 99
        with pytest.raises(CameraLost, match=r"given up.*still unplugged"):
            run_session(source, lambda *_: None, policy=Policy.NEWEST)


def test_the_lasting_name_is_the_link_by_id(tmp_path):
    ids = tmp_path / "v4l" / "by-id"
    ids.mkdir(parents=True)
    for name in ("video0", "video1"):
        (tmp_path / name).touch()
    link = ids / "usb-Fake_Fisheye-video-index0"
    link.symlink_to("../../video1")
    for device in ("1", str(tmp_path / "video1"), str(link)):
        assert _lasting_name(device, tmp_path) == str(link)
    for device in ("0", str(tmp_path / "video0"), "Fake fisheye"):
        assert _lasting_name(device, tmp_path) == device


def test_counts_are_what_the_camera_saw(port):
    with live(port, exposures_s=(0.001,)) as source:
        bracket = next(iter(source))
    expected = port.cameras[0]._counts(bracket.frames[0].exposure, 0)
    assert np.abs(bracket.frames[0].counts.astype(int) - expected).mean() < 8  # JPEG
