"""A recording played at its own pace: on time, rising, over and over, and ended when asked to."""

import threading
import time
from itertools import islice, pairwise

import pytest

from capture.errors import UnreadableFrame
from capture.frame import Bracket
from capture.v4l2.camera import CameraRequest
from render.live.sources import PacedRecording, open_source
from tests.render.live_recording import make_recording


@pytest.fixture
def recording(tmp_path):
    return make_recording(tmp_path / "r")


def test_rounds_follow_each_other_with_rising_times_and_numbers(recording):
    brackets = list(islice(PacedRecording(recording), 8))
    assert [bracket.index for bracket in brackets] == list(range(8))
    frames = [frame.index for bracket in brackets for frame in bracket.frames]
    assert frames == list(range(16))
    times_s = [bracket.timestamp_s for bracket in brackets]
    gaps_s = [after - before for before, after in pairwise(times_s)]
    assert all(gap_s >= 0.0199 for gap_s in gaps_s)  # 0.02 s, and more where it was held up


def test_a_bracket_comes_when_it_is_due(recording):
    for bracket in islice(PacedRecording(recording), 4):
        assert 0 <= time.monotonic() - bracket.timestamp_s < 1.0


def test_a_rate_takes_the_place_of_its_own_pace(recording):
    with open_source(CameraRequest(str(recording.folder), frame_rate_hz=200.0)) as source:
        first, second = islice(source, 2)
    assert second.timestamp_s - first.timestamp_s >= 0.00499
    slow = PacedRecording(recording, rate_hz=10.0)
    first, second = islice(slow, 2)
    assert second.timestamp_s - first.timestamp_s >= 0.0999


def test_once_is_once(recording):
    assert len(list(PacedRecording(recording, once=True))) == 3


def test_a_damaged_bracket_is_told_and_the_next_one_comes(recording):
    (recording.folder / "frames" / "000002.png").unlink()
    items = list(PacedRecording(recording, once=True))
    assert [isinstance(item, UnreadableFrame) for item in items] == [False, True, False]
    assert [item.index for item in items if isinstance(item, Bracket)] == [0, 2]


def test_stop_ends_a_wait(recording):
    source = PacedRecording(recording, rate_hz=0.01)
    iterator = iter(source)
    next(iterator)
    threading.Timer(0.05, source.stop).start()
    begin_s = time.monotonic()
    assert next(iterator, None) is None
    assert time.monotonic() - begin_s < 5.0


def test_the_last_bracket_is_repeated_at_once_when_something_was_changed(recording):
    source = PacedRecording(recording, rate_hz=0.01)
    iterator = iter(source)
    first = next(iterator)
    source.repeat()
    assert next(iterator) is first
