"""A live camera recorded: all that came is on the disk or counted, however the recording ends."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from capture import recorder, reopening
from capture.errors import CameraLost, InputError, UnreadableFrame
from capture.manifest import JOURNAL_NAME
from capture.recorder import Length, Recorded, record
from capture.recording import open_recording
from capture.recording_writer import RecordingWriter
from capture.sensor import Sensor
from capture.v4l2.camera import CameraRequest
from tests.capture.fake_camera import UNPLUGGED, FakePort, scene

ROOT = Path(__file__).resolve().parents[2]
REQUEST = CameraRequest("/dev/video7")
TIMES_S = (0.001, 0.02)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    for name in ("FIRST_WAIT_S", "LONGEST_WAIT_S", "TICK_S"):
        monkeypatch.setattr(reopening, name, 0.001)


@pytest.fixture
def port():
    return FakePort(scene())


def recorded(port, folder, *, brackets=4, exposures_s=TIMES_S, **options) -> Recorded:
    return record(
        REQUEST,
        folder,
        exposures_s=exposures_s,
        length=Length(brackets),
        stopped=options.pop("stopped", threading.Event()),
        open_camera=port.open,
        **options,
    )


def listed(folder):
    return open_recording(folder).manifest.frames


def test_jpeg_is_stored_as_it_came_with_what_is_known_of_it(tmp_path, port):
    sent = []
    opened = port.open

    def spied(request):
        camera = opened(request)
        capture = camera.capture_undecoded
        camera.capture_undecoded = lambda times_s: sent.append(capture(times_s)) or sent[-1]
        return camera

    port.open = spied
    result = recorded(port, tmp_path / "r")
    assert (result.captured, result.written, result.frames) == (4, 4, 8)
    frames = [frame for bracket in sent for frame in bracket]
    for entry, frame in zip(listed(tmp_path / "r"), frames, strict=True):
        assert (tmp_path / "r" / entry.file).read_bytes() == frame.data
        assert entry.file.endswith(".jpg")
        assert (entry.time_s, entry.timestamp_s) == (frame.exposure.time_s, frame.timestamp_s)
        assert entry.sequence == frame.index
    manifest = json.loads((tmp_path / "r" / "manifest.json").read_text())
    assert manifest["camera"] == "Fake fisheye"
    assert manifest["device"] == {
        "path": "/dev/video7",
        "pixel_format": "MJPG",
        "frame_interval_s": 1 / 30,
        "driver": "fake",
        "controls": {"White Balance, Automatic": 0, "Gain": 4},
    }
    assert [entry["index"] for entry in manifest["frames"]] == list(range(8))
    assert [entry["bracket"] for entry in manifest["frames"]] == [0, 0, 1, 1, 2, 2, 3, 3]
    assert not port.cameras[0].is_open


@pytest.mark.parametrize(
    "sensor", [None, Sensor(0.0, 4095.0, source="12 bits")], ids=["8 bit", "12 bit"]
)
def test_other_formats_are_stored_without_loss(tmp_path, port, sensor):
    port.pixel_format = "YUYV"
    port.sensor = sensor or port.sensor
    recorded(port, tmp_path / "r")
    recording = open_recording(tmp_path / "r")
    assert recording.sensor.white_dn == port.sensor.white_dn
    for number, bracket in enumerate(recording):
        for frame in bracket.frames:
            expected = port.cameras[0]._counts(frame.exposure, number)
            assert np.array_equal(frame.counts, expected)


def test_exposures_are_chosen_for_the_scene(tmp_path, port, monkeypatch):
    # Each capture waits for the choice before it, as if the camera took its time.
    idle = threading.Event()
    idle.set()
    look, capture = recorder._look, recorder._capture

    def looking(*arguments):
        look(*arguments)
        idle.set()

    def capturing(*arguments, **options):
        idle.wait(5)
        idle.clear()
        return capture(*arguments, **options)

    monkeypatch.setattr(recorder, "_look", looking)
    monkeypatch.setattr(recorder, "_capture", capturing)
    recorded(port, tmp_path / "r", exposures_s=None, brackets=6)
    counts = [len(bracket.frames) for bracket in open_recording(tmp_path / "r")]
    assert counts[0] == 3  # the probe
    assert counts[-1] == 2


def test_a_slow_disk_costs_brackets_that_are_counted_and_no_time(tmp_path, port, monkeypatch):
    monkeypatch.setattr(recorder, "QUEUED_BRACKETS", 3)
    resumes = threading.Event()
    write = RecordingWriter.write_encoded

    def slow(*arguments, **options):
        resumes.wait(5)
        write(*arguments, **options)

    monkeypatch.setattr(RecordingWriter, "write_encoded", slow)

    def report(so_far):
        if so_far.captured == 10:
            resumes.set()

    result = recorded(port, tmp_path / "r", brackets=10, report=report)
    assert result.captured == 10
    assert result.dropped == 7
    assert result.written == 3
    indices = [entry.index for entry in listed(tmp_path / "r")]
    assert indices == [0, 1, 2, 3, 4, 5]


def test_dropped_brackets_are_gaps_in_the_manifest(tmp_path, port, monkeypatch):
    monkeypatch.setattr(recorder, "QUEUED_BRACKETS", 1)
    written = threading.Event()
    write = recorder._write

    def slow(writer, taken, so_far):
        if taken.number == 0:
            written.wait(5)
        write(writer, taken, so_far)

    monkeypatch.setattr(recorder, "_write", slow)

    def report(so_far):
        if so_far.captured == 3:
            written.set()
            while not so_far.written:
                time.sleep(0.001)
            time.sleep(0.02)  # until the first write's future is done

    recorded(port, tmp_path / "r", report=report)
    assert [entry.index for entry in listed(tmp_path / "r")] == [0, 1, 6, 7]


def test_it_ends_when_it_is_stopped_and_after_a_duration(tmp_path, port):
    stopped = threading.Event()

    def report(so_far):
        if so_far.captured == 5:
            stopped.set()

    result = recorded(port, tmp_path / "r", brackets=None, stopped=stopped, report=report)
    assert result.written == 5
    started_s = time.monotonic()
    record(
        REQUEST,
        tmp_path / "s",
        exposures_s=TIMES_S,
        length=Length(duration_s=0.1),
        stopped=threading.Event(),
        open_camera=port.open,
    )
    assert 0.1 <= time.monotonic() - started_s < 5


def test_a_camera_that_comes_back_goes_on_in_the_same_recording(tmp_path, port):
    port.faults = {2: UNPLUGGED, 3: UnreadableFrame("damaged")}
    result = recorded(port, tmp_path / "r")
    assert (result.written, result.unreadable, result.reopened_count) == (4, 1, 1)
    frames = listed(tmp_path / "r")
    assert [frame.index for frame in frames] == list(range(8))
    assert [frame.sequence for frame in frames] == [2, 4, 6, 8, 2, 4, 6, 8]


def test_a_camera_that_is_given_up_leaves_a_complete_recording(tmp_path, port):
    port.faults = {2: UNPLUGGED}

    def report(so_far):
        port.openings_refused = [CameraLost("still unplugged")] * 99

    result = recorded(port, tmp_path / "r", report=report)
    assert isinstance(result.ended_by, CameraLost)
    assert len(open_recording(tmp_path / "r")) == 2
    assert not (tmp_path / "r" / JOURNAL_NAME).exists()


def test_jpeg_is_not_decoded_for_exposures_that_are_fixed(tmp_path, port, monkeypatch):
    monkeypatch.setattr("tests.capture.fake_camera.FakeCamera.decode", None)
    result = recorded(port, tmp_path / "r", brackets=9)
    assert (result.written, result.ended_by) == (9, None)


def test_even_a_defect_leaves_what_was_recorded(tmp_path, port):
    def report(so_far):
        if so_far.written >= 2:
            raise ZeroDivisionError

    assert isinstance(
        recorded(port, tmp_path / "r", brackets=None, report=report).ended_by, ZeroDivisionError
    )
    assert len(open_recording(tmp_path / "r")) >= 2


def test_frames_that_do_not_decode_are_left_out_and_counted(tmp_path, port, monkeypatch):
    port.pixel_format = "YUYV"

    def decode(camera, frame):
        raise UnreadableFrame("a sample lies above white")

    decoded = port.open(REQUEST).decode
    monkeypatch.setattr(
        "tests.capture.fake_camera.FakeCamera.decode",
        lambda camera, frame: decode(camera, frame) if frame.index == 6 else decoded(frame),
    )
    result = recorded(port, tmp_path / "r")
    assert (result.captured, result.written, result.damaged) == (4, 3, 1)
    assert [entry.bracket for entry in listed(tmp_path / "r")] == [0, 0, 2, 2, 3, 3]


def test_without_a_bracket_nothing_is_left_behind(tmp_path, port):
    port.faults = dict.fromkeys(range(99), UNPLUGGED)
    with pytest.raises(CameraLost, match="given up"):
        recorded(port, tmp_path / "r")
    stopped = threading.Event()
    stopped.set()
    with pytest.raises(InputError, match="not one bracket"):
        recorded(port, tmp_path / "r", stopped=stopped)
    assert list(tmp_path.iterdir()) == []


def test_an_older_recording_is_refused_before_the_camera_is_opened(tmp_path, port):
    recorded(port, tmp_path / "r", brackets=1)
    with pytest.raises(InputError, match="--force"):
        recorded(port, tmp_path / "r")
    assert port.open_count == 1
    recorded(port, tmp_path / "r", force=True)
    assert len(open_recording(tmp_path / "r")) == 4


def test_a_calibration_that_cannot_be_used_is_refused_before_the_camera_is_opened(tmp_path, port):
    with pytest.raises(InputError, match=r"none\.json"):
        recorded(port, tmp_path / "r", calibration=tmp_path / "none.json")
    assert port.open_count == 0


@pytest.mark.parametrize("limit", [1500, 2500])
def test_a_disk_that_fills_up_leaves_a_readable_recording(tmp_path, port, limit):
    # A limit on the size of a file fails as a full disk does: with a part of a write, then none.
    # The journal meets it first; the manifest, which repeats it, does not fit either.
    older = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, older[1]))
    try:
        with pytest.raises(InputError, match=r"manifest\.json: cannot be written .*can be read"):
            recorded(port, tmp_path / "r", brackets=50)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, older)
    journal = (tmp_path / "r" / JOURNAL_NAME).read_bytes()
    assert limit - 600 < len(journal) < limit
    assert journal.endswith(b"\n")
    brackets = list(open_recording(tmp_path / "r"))
    assert len(brackets) >= 2
    assert {len(bracket.frames) for bracket in brackets} == {2}


def test_a_journal_that_the_disk_takes_in_parts_is_whole(tmp_path, port, monkeypatch):
    class InParts:
        def __init__(self, file):
            self.file = file

        def write(self, line):
            return self.file.write(line[:100])

        def tell(self):
            return self.file.tell()

        def close(self):
            self.file.close()
            lines = Path(self.file.name).read_text().splitlines()
            assert [json.loads(line)["index"] for line in lines] == [0, 1]

    create = recorder.create_recording

    def created(*arguments, **options):
        writer = create(*arguments, **options)
        writer._journal = InParts(writer._journal)
        return writer

    monkeypatch.setattr(recorder, "create_recording", created)
    recorded(port, tmp_path / "r", brackets=1)


@pytest.mark.parametrize("first", [4, 5])
def test_a_frame_that_does_not_fit_ends_a_recording_of_whole_brackets(
    tmp_path, port, monkeypatch, first
):
    """A bracket has two: 4 begins one and 5 completes it."""
    write = RecordingWriter.write_encoded

    def full(self, *arguments, **options):
        if options["index"] >= first:
            raise InputError("frame: cannot be written (No space left on device)")
        write(self, *arguments, **options)

    monkeypatch.setattr(RecordingWriter, "write_encoded", full)
    result = recorded(port, tmp_path / "r", brackets=None)
    assert "No space left" in str(result.ended_by)
    assert (result.written, result.frames) == (2, 4)
    assert [len(bracket.frames) for bracket in open_recording(tmp_path / "r")] == [2, 2]
    assert len(list((tmp_path / "r" / "frames").iterdir())) == 4
    assert not (tmp_path / "r" / JOURNAL_NAME).exists()


PROGRAM = """
import time
from capture import record_cli, recorder
from render.main import main
from tests.capture.fake_camera import FakeCamera, FakePort, scene

capture = FakeCamera.capture_undecoded
FakeCamera.capture_undecoded = lambda *a: time.sleep(0.01) or capture(*a)
recorder.record.__kwdefaults__["open_camera"] = FakePort(scene()).open
main()
"""


def started(folder, *arguments):
    """Start `fishlight record` with a fake camera, and return it when two brackets are written."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "record", "fake", folder, *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    journal = folder / JOURNAL_NAME
    while not journal.exists() or journal.read_bytes().count(b"\n") < 6:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    return process


def test_ctrl_c_leaves_a_complete_recording_and_one_line(tmp_path):
    process = started(tmp_path / "r")
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=20)
    assert (process.returncode, error) == (0, "")
    assert out.startswith(f"{tmp_path / 'r'}: brackets ")
    assert out.count("\n") == 1
    assert not (tmp_path / "r" / JOURNAL_NAME).exists()
    assert len(open_recording(tmp_path / "r")) >= 2


def test_kill_9_leaves_a_readable_recording(tmp_path):
    process = started(tmp_path / "r", "--exposures", "1/1000,1/50")
    process.kill()
    process.communicate()
    assert (tmp_path / "r" / JOURNAL_NAME).exists()
    brackets = list(open_recording(tmp_path / "r"))
    assert len(brackets) >= 2
    assert {len(bracket.frames) for bracket in brackets} == {2}
