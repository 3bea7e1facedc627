"""What every source of brackets keeps to (capture.frame.FrameSource)."""

import numpy as np
import pytest

from capture.errors import UnreadableFrame
from capture.frame import Bracket, Exposure
from capture.live_source import LiveSource
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor
from capture.v4l2.camera import CameraRequest
from tests.capture.fake_camera import FakeCamera, FakePort, scene


def complete_recording(folder):
    """Three brackets of two exposures; the clock steps back once, a frame number is left out."""
    timestamps_s = (0.0, 0.1, 5.0, 5.1, 1.0, 1.1)
    with create_recording(folder, "", assumed_sensor(np.uint8)) as writer:
        for position, timestamp_s in enumerate(timestamps_s):
            picture = np.full((4, 5, 3), position, np.uint8)
            exposure = Exposure((0.1, 0.4)[position % 2])
            index = position if position < 3 else position + 1
            writer.write_frame(picture, exposure, timestamp_s, position // 2, index=index)
    return open_recording(folder)


def damaged_recording(folder):
    complete_recording(folder)
    (folder / "frames" / "000002.png").unlink()
    return open_recording(folder)


class _Stopping(FakeCamera):
    """A camera whose user has had enough at every third bracket."""

    def capture(self, times_s):
        if self.port.brackets % 3 == 2:
            self.port.source.stop()
        return super().capture(times_s)


def live_camera(_folder):
    port = FakePort(scene(4, 5), faults={1: UnreadableFrame("the frame's JPEG is damaged")})
    port.source = LiveSource(CameraRequest("fake"), open_camera=lambda _request: _Stopping(port))
    return port.source


@pytest.fixture(params=[complete_recording, damaged_recording])
def recording(request, tmp_path):
    return request.param(tmp_path / "r")


@pytest.fixture(params=[complete_recording, damaged_recording, live_camera])
def source(request, tmp_path):
    return request.param(tmp_path / "r")


def frames_of(source):
    return [frame for item in source if isinstance(item, Bracket) for frame in item.frames]


def test_it_gives_brackets_or_the_reason_why_not(source):
    assert all(isinstance(item, Bracket | UnreadableFrame) for item in source)


def test_it_ends(source):
    assert len(list(source)) == 3


def test_a_recording_says_how_many_items_it_has(recording):
    assert len(recording) == len(list(recording))


def test_indices_rise(source):
    indices = [frame.index for frame in frames_of(source)]
    assert all(np.diff(indices) > 0)
    brackets = [item.index for item in source if isinstance(item, Bracket)]
    assert all(np.diff(brackets) > 0)


def test_timestamps_never_fall(source):
    assert all(np.diff([frame.timestamp_s for frame in frames_of(source)]) >= 0)


def test_a_recordings_bracket_timestamps_never_fall(recording):
    assert all(np.diff(recording.bracket_timestamps_s) >= 0)


def test_it_can_be_iterated_again(source):
    assert len(list(source)) == len(list(source)) == 3


def test_a_live_source_goes_on_where_it_was_left():
    source = live_camera(None)
    first, second = frames_of(source), frames_of(source)
    assert second[0].index > first[-1].index
    assert second[0].timestamp_s > first[-1].timestamp_s


def test_a_recording_gives_the_same_again(recording):
    first, second = frames_of(recording), frames_of(recording)
    assert len(first) == len(second) > 0
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.counts, other.counts)
        assert (one.exposure, one.timestamp_s, one.index) == (
            other.exposure,
            other.timestamp_s,
            other.index,
        )


def test_all_frames_have_one_size(source):
    assert {frame.size_px for frame in frames_of(source)} == {source.size_px}


def test_counts_cannot_be_changed_by_a_consumer(source):
    frame = frames_of(source)[0]
    with pytest.raises(ValueError, match="read-only"):
        frame.counts[0, 0, 0] = 1
