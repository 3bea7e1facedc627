"""`fishlight record`, as a shell calls it; the camera is a fake one."""

import io

import pytest

from capture import record_cli, reopening
from capture.errors import CameraLost
from capture.recorder import Recorded, record
from capture.recording import open_recording
from render.main import main
from tests.capture.fake_camera import UNPLUGGED, FakePort, scene


@pytest.fixture
def port(monkeypatch):
    port = FakePort(scene())
    monkeypatch.setitem(record.__kwdefaults__, "open_camera", port.open)
    for name in ("FIRST_WAIT_S", "LONGEST_WAIT_S", "TICK_S"):
        monkeypatch.setattr(reopening, name, 0.001)
    return port


def run(*tokens):
    """Return the exit code."""
    try:
        main(["record", *map(str, tokens)])
    except SystemExit as end:
        return end.code or 0
    return 0


def test_a_recording_is_made_and_told_in_a_line(tmp_path, port, capsys):
    assert run("0", tmp_path / "r", "--exposures", "1/1000,1/50", "--brackets", 3) == 0
    printed = capsys.readouterr()
    assert printed.out == (
        f"{tmp_path / 'r'}: brackets 3, dropped 0, unreadable 0, frames 6, frames the camera lost "
        "0, reopened 0; last exposures 0.001, 0.02 s\n"
    )
    assert printed.err == ""
    assert len(open_recording(tmp_path / "r")) == 3


def test_what_is_asked_for_reaches_the_camera(tmp_path, port, monkeypatch):
    requests = []
    monkeypatch.setitem(
        record.__kwdefaults__,
        "open_camera",
        lambda request: requests.append(request) or port.open(request),
    )
    options = ("--size", "320x240", "--format", "YUYV", "--rate", "15", "--duration-s", "0.2")
    assert run("/dev/video3", tmp_path / "r", *options) == 0
    (request,) = requests
    assert (request.device, request.size_px) == ("/dev/video3", (320, 240))
    assert (request.pixel_format, request.frame_rate_hz) == ("YUYV", 15.0)


def test_a_calibration_is_copied(tmp_path, port):
    (tmp_path / "cal.json").write_text('{"model": "equidistant"}')
    run("0", tmp_path / "r", "--brackets", 1, "--calibration", tmp_path / "cal.json")
    assert open_recording(tmp_path / "r").calibration_path is not None


def test_a_camera_that_is_given_up_is_told_after_what_was_recorded(tmp_path, port, capsys):
    port.faults = {2: UNPLUGGED}
    real_open = port.open

    def opened_once(request):
        if port.open_count:
            raise CameraLost("still unplugged")
        return real_open(request)

    record.__kwdefaults__["open_camera"] = opened_once
    assert run("0", tmp_path / "r", "--exposures", "0.01") == 2
    printed = capsys.readouterr()
    assert "brackets 2" in printed.out
    assert "given up" in printed.err
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mains-hz", "100"), "--mains-hz 100: wanted 50, 60, or 0"),
        (("--brackets", "0"), "--brackets 0: wanted more than 0"),
        (("--duration-s", "-1"), "--duration-s -1: wanted more than 0"),
        (("--rate", "nan"), "--rate nan: wanted more than 0"),
        (("--size", "large"), "WIDTHxHEIGHT"),
        (("--exposures", "fast"), "--exposures: 'fast' is no time in seconds"),
        (("--exposures", "3"), "cannot expose for 3 s"),
        (("--calibration", "none.json"), "none.json"),
    ],
)
def test_wrong_wishes_are_a_line_and_leave_nothing(tmp_path, port, capsys, options, message):
    assert run("0", tmp_path / "r", *options) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    assert not any(camera.is_open for camera in port.cameras)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_progress_and_trouble(monkeypatch):
    monkeypatch.setenv("COLUMNS", "150")
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with record_cli._progress(10) as show:
        show(Recorded(captured=3, written=3, times_s=(0.001, 0.02)))
        show(Recorded(captured=3, written=3, trouble="the last bracket is 2.0 s old"))
    assert "the last bracket is 2.0 s old" in terminal.getvalue()
