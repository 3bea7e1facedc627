"""A camera from its driver to radiance: one guest, whose outcomes are judged here.

In the guest stands the emulated camera (uvc_camera.py) at the kernel's own uvcvideo driver, and
camera_schedule.py does all that these tests ask about. Each frame bears its true exposure, and the
scene's radiance is known.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.files import read_calibration
from capture.errors import UnreadableFrame
from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from capture.recording import open_recording
from capture.reopening import CameraAway
from capture.sensor import Sensor
from render.live.desk import Desk, LiveFrame
from render.live.models import load_models
from render.live.session import LiveSession
from render.live.settings import Settings
from render.live.stream import stream_message
from tests.camera.camera_schedule import BRACKETS, LIVE_BRACKETS, TIMES_S
from tests.camera.required_guest import run_schedule
from tests.camera.scene_pictures import UNIT_S, PictureSet, patches, write_pictures
from tests.camera.uvc_stamp import stamp_of_counts, stamp_of_data

pytestmark = [pytest.mark.camera, pytest.mark.slow]

SIDE_PX = 16
RECORDINGS = ("recorded-YUYV", "replugged-MJPG", "killed-RG16")

Facts = dict[str, Any]


@dataclass(frozen=True)
class Session:
    """What came out of the guest."""

    share: Path
    steps: dict[str, Facts]
    sent: dict[int, Facts]
    """Of each frame that the camera sent, by its number."""


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    share = tmp_path_factory.mktemp("guest")
    (share / "pictures").mkdir()
    write_pictures(share / "pictures", patches(), PictureSet())
    run_schedule("camera_schedule", share, ["vhci_hcd", "uvcvideo"])
    steps, sent = lines(share / "report.jsonl"), lines(share / "camera.jsonl")
    return Session(
        share,
        {step["step"]: step for step in steps},
        {facts["frame"]: facts for facts in sent if "frame" in facts},
    )


def lines(path: Path) -> list[Facts]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def outcome(session: Session, name: str) -> Facts:
    step = session.steps[name]
    assert "error" not in step, step["error"]
    return step


def test_exposure_set_in_automatic_mode_is_refused_by_name(session: Session) -> None:
    refusal = outcome(session, "automatic")["refusal"]
    assert refusal.startswith("InputError: ")
    assert "Exposure" in refusal
    assert "automatic" in refusal
    assert "\n" not in refusal


def test_no_frame_is_mislabelled(session: Session) -> None:
    step = outcome(session, "brackets")
    brackets = [*step["brackets"], step["after_pause"]]
    assert [len(bracket) for bracket in brackets] == [len(TIMES_S)] * (BRACKETS + 1)
    for frame in (frame for bracket in brackets for frame in bracket):
        assert_labelled(session, frame)


def test_frames_after_a_pause_are_new(session: Session) -> None:
    step = outcome(session, "brackets")
    numbers = [frame["stamp"][0] for frame in step["after_pause"]]
    assert all(session.sent[number]["time_s"] > step["resumed_s"] for number in numbers)
    assert step["counters"]["stale"] > 0  # the queue was full of old ones


def assert_labelled(session: Session, frame: Facts) -> None:
    number, exposure, gain = frame["stamp"]
    assert frame["time_s"] == pytest.approx(exposure * UNIT_S)
    assert (frame["gain"], gain) == (1.0, 0)
    assert session.sent[number]["exposure"] == exposure
    assert not session.sent[number]["automatic"]


def test_corrupt_frames_are_told_and_are_no_part_of_a_bracket(session: Session) -> None:
    step = outcome(session, "faults")
    assert step["corrupt"].startswith("UnreadableFrame: ")
    assert step["counters"]["errors"] > 0
    for frame in step["mended"]:
        assert_labelled(session, frame)
        assert not session.sent[frame["stamp"][0]]["corrupt"]


def test_stalled_camera_is_told_in_bounded_time(session: Session) -> None:
    step = outcome(session, "faults")
    assert step["stall"].startswith("CameraStalled: ")
    assert step["stall_s"] < 10
    for frame in step["resumed"]:
        assert_labelled(session, frame)


def test_unplugged_camera_is_told_at_once(session: Session) -> None:
    step = outcome(session, "faults")
    assert step["unplug"].startswith("CameraLost: ")
    assert step["unplug_s"] < 2


@pytest.mark.parametrize(
    ("name", "brackets"), [("recorded-YUYV", BRACKETS), ("replugged-MJPG", 2 * BRACKETS)]
)
def test_recording_is_complete(session: Session, name: str, brackets: int) -> None:
    log = (session.share / "recordings" / f"{name}.log").read_text()
    assert outcome(session, name)["status"] == 0, log
    recording = open_recording(session.share / "recordings" / name)
    assert len(recording) == brackets
    assert not (session.share / "recordings" / name / "frames.jsonl").exists()
    assert f"reopened {int('replugged' in name)};" in log


def test_recording_of_a_killed_recorder_is_readable(session: Session) -> None:
    assert outcome(session, "killed-RG16")["status"] == -9
    recording = open_recording(session.share / "recordings" / "killed-RG16")
    assert len(recording) >= 2
    assert len(recording.read_bracket(1).frames) == len(TIMES_S)


@pytest.mark.parametrize("name", RECORDINGS)
def test_recorded_frames_are_labelled_with_their_true_exposure(session: Session, name: str) -> None:
    # That of replugged-MJPG came back automatic, as from the factory, in the middle of it.
    recording = open_recording(session.share / "recordings" / name)
    for record in recording.manifest.frames:
        path = session.share / "recordings" / name / record.file
        if path.suffix == ".jpg":
            stamp = stamp_of_data(path.read_bytes(), "MJPG", 160)
        else:
            frames = recording.read_bracket(record.bracket).frames
            (frame,) = (frame for frame in frames if frame.index == record.index)
            stamp = stamp_of_counts(frame.counts)
        assert record.time_s == pytest.approx(stamp.exposure * UNIT_S)
        assert session.sent[stamp.frame]["exposure"] == stamp.exposure
        assert stamp.gain == 0


@pytest.mark.parametrize("name", RECORDINGS)
def test_merged_radiance_is_that_of_the_scene(session: Session, name: str) -> None:
    # Every square has an exposure at which its channels are 0.09 of white at least, 85 of 255 in
    # sRGB, where a count is 2.4 % of light. 8-bit formats round by up to 1.4 counts: luma by
    # ½ · 255/219, colour differences by ½ · 1.402 · 255/224. Of raw ones, shot and read noise is
    # 3.4 % there, and a square's middle averages 16 samples of red and of blue: 4 σ are 3.4 %.
    # Over 50 squares and three channels such errors average to 0.1 %. Around full, 0.98 of white,
    # noise of 1 % decides what clips.
    recording = open_recording(session.share / "recordings" / name)
    truth = middles(patches())
    full = truth.max(axis=-1) * min(TIMES_S)
    for index in range(2):
        image = merge_bracket(recording.read_bracket(index), recording.sensor)
        ratio = middles(image.radiance) / truth
        is_seen, is_clipped = full < 0.9, full > 1.06
        assert np.abs(ratio[is_seen] - 1).max() < 0.035
        assert abs(ratio[is_seen].mean() - 1) < 0.005
        assert middles(image.valid)[is_seen].min() == 1
        clipped = middles(image.clipped)
        assert clipped[is_seen].max() == 0
        assert clipped[is_clipped].min() > 0.9  # rounded colour differences hide some
        assert ratio[is_clipped].max() < 1.035  # a lower bound


def middles(picture: NDArray[Any]) -> NDArray[np.float64]:
    """Return the mean over the inner quarter of each square of the scene, (7, 10, channels)."""
    rows = np.asarray(picture, np.float64)[: 7 * SIDE_PX]
    squares = rows.reshape(7, SIDE_PX, 10, SIDE_PX, -1)
    return squares[:, 4:12, :, 4:12].mean(axis=(1, 3))


class Forwarded:
    """What a live source gave in the guest, given again here; each when the last was published."""

    name = "emulated"
    reopened_count = 1

    def __init__(
        self, folder: Path, came: list[Facts], sensor: Sensor, moments: list[LiveFrame]
    ) -> None:
        self.sensor = sensor
        self._moments = moments
        self.items: list[Bracket | UnreadableFrame] = []
        for number, facts in enumerate(came):
            if "times_s" in facts:
                counts = np.load(folder / f"{number}.npy")
                self.items.append(bracket_of(counts, facts["times_s"], number))
            elif facts["is_away"]:
                self.items.append(CameraAway(facts["error"], 0.0))
            else:
                self.items.append(UnreadableFrame(facts["error"]))
        first = next(item for item in self.items if isinstance(item, Bracket))
        self.size_px = first.frames[0].size_px

    def __iter__(self) -> Iterator[Bracket | UnreadableFrame]:
        for number, item in enumerate(self.items):
            while len(self._moments) < number:
                time.sleep(0.005)
            if isinstance(item, Bracket):
                stamp_s = time.monotonic()
                frames = tuple(replace(frame, timestamp_s=stamp_s) for frame in item.frames)
                yield Bracket(frames, item.index)
            else:
                yield item


def bracket_of(counts: NDArray[Any], times_s: list[float], number: int) -> Bracket:
    frames = zip(counts, times_s, strict=True)
    return Bracket(
        tuple(
            Frame(each, Exposure(time_s), 0.0, len(times_s) * number + position)
            for position, (each, time_s) in enumerate(frames)
        ),
        number,
    )


def test_a_live_session_says_that_the_camera_is_away_and_goes_on_when_it_is_back(
    session: Session, tmp_path: Path
) -> None:
    step = outcome(session, "live-YUYV")
    assert step["reopened"] == 1
    sensor = open_recording(session.share / "recordings" / "recorded-YUYV").sensor
    moments: list[LiveFrame] = []
    source = Forwarded(session.share / "recordings" / "live", step["came"], sensor, moments)
    for item in source.items:
        if isinstance(item, Bracket):
            for frame in item.frames:
                stamp = stamp_of_counts(frame.counts)
                assert frame.exposure.time_s == pytest.approx(stamp.exposure * UNIT_S)

    desk = Desk(Settings(count=8, is_steady=False), load_models(()))
    desk.listen(lambda: moments.append(desk.newest) if desk.newest else None)
    width, height = source.size_px
    (tmp_path / "cal.json").write_text(
        json.dumps(
            {
                "model": "equidistant",
                "image_size_px": [width, height],
                "centre_px": [(width - 1) / 2, 7 * SIDE_PX / 2],
                "focal_px": 50.0,
                "valid_angle_rad": 1.0,  # within the squares
            }
        )
    )
    calibration = read_calibration(tmp_path / "cal.json")
    counters = LiveSession(desk, source, calibration, 32, None, lambda *_: None).run()

    assert counters.captured == len(step["came"])
    assert counters.rendered == 2 * LIVE_BRACKETS
    states = [moment.state.name for moment in moments]
    away = states.count("away")
    assert away >= 2
    expected = ["running"] * LIVE_BRACKETS + ["away"] * away + ["running"] * LIVE_BRACKETS
    assert states == [*expected, "ended"]
    before, gone = moments[LIVE_BRACKETS - 1], moments[LIVE_BRACKETS : LIVE_BRACKETS + away]
    back = moments[LIVE_BRACKETS + away]
    assert all(moment.seen is before.seen for moment in gone), "the last good lights stay"
    ages_s = [moment.age_s for moment in [before, *gone]]
    assert ages_s == sorted(ages_s)
    assert json.loads(stream_message(gone[-1]))["stale"]
    assert not json.loads(stream_message(back))["stale"]
    assert before.seen is not None
    assert back.seen is not None
    np.testing.assert_allclose(
        back.seen.lights.integral(), before.seen.lights.integral(), rtol=0.02
    )
