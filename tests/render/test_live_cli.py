"""`fishlight live` on the command line: it runs, ends, counts, and refuses in one line."""

import re
import signal
import threading

import pytest

from render.main import main
from tests.render.live_recording import make_recording

SMALL = ["--size", "32x24", "--height", "32", "--headless"]
ANY_PORT = ["--port", "0"]


def fishlight(*arguments):
    with pytest.raises(SystemExit) as end:
        main(list(map(str, arguments)))
    return end.value.code


def test_a_recording_played_once_is_accounted_for(tmp_path, capsys):
    recording = make_recording(tmp_path / "r")
    assert not fishlight("live", recording.folder, "--once", *SMALL, *ANY_PORT, "--count", "9")
    address, _, account = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{43}", address)
    counts = {name: int(count) for count, name in re.findall(r"(\d+) (\w+)", account)}
    assert counts["captured"] == 3 == counts["replaced"] + counts["rendered"] + counts["failed"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--port", "70000"], "--port 70000: wanted 0 to 65535"),
        (["--rate", "0"], "--rate 0: wanted more than 0"),
        (["--mains-hz", "55"], "--mains-hz 55"),
        (["--fps", "0"], "frame_rate_hz"),
        (["--exposures", "1/0"], "no time in seconds"),
        (["--count", "0"], "count"),
        (["--count", "auto", "--method", "median-cut"], "--count auto is for"),
        (["--origin", "*"], "--origin"),
        (["--host", "203.0.113.7"], "--host 203.0.113.7"),
        (["--mesh", "nothing.obj"], "nothing.obj"),
        (["--calibration", "nothing.json"], "nothing.json"),
        (["-o", __file__], "is a file; name a folder"),
        (["other"], "are for --blend"),
        (["--place", "0,0,0"], "are for --blend"),
        (["other", "--blend", "--place", "0,0,0"], "--place x,y,z for each, got 2 and 1"),
        (["--blend", "--place", "0,0,0"], "wanted at least 2 sources"),
        (["other", "--blend", "--place", "0,0", "--place", "-1,0,0"], "--place 0,0: wanted metres"),
        (["b", "c", *["--calibration", "x"] * 2], "3 sources and 2 calibrations"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, capsys, arguments, message):
    recording = make_recording(tmp_path / "r")
    port = [] if "--port" in arguments else ANY_PORT
    assert fishlight("live", recording.folder, *arguments, "--once", *SMALL, *port) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_two_recordings_are_blended_and_accounted_for(tmp_path, capsys):
    for name in "ab":
        (tmp_path / name).mkdir()
    sources = [make_recording(tmp_path / name / "r").folder for name in "ab"]
    places = ["--place", "-1,0,0", "--place", "1,0,0"]
    assert not fishlight("live", *sources, "--blend", *places, "--once", *SMALL, *ANY_PORT)
    counts = {
        name: int(count)
        for count, name in re.findall(r"(\d+) (\w+)", capsys.readouterr().out.splitlines()[-1])
    }
    assert counts["captured"] == 6 == counts["replaced"] + counts["rendered"] + counts["failed"]


def test_a_defect_of_the_server_ends_the_session_with_its_traceback(tmp_path, monkeypatch):
    def fail(_frame):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("render.live.server.stream_message", fail)
    recording, waited = make_recording(tmp_path / "r"), threading.Event()

    def give_up():
        waited.set()
        signal.raise_signal(signal.SIGINT)

    guard = threading.Timer(60.0, give_up)
    guard.start()
    try:
        with pytest.raises(ZeroDivisionError):
            main(["live", str(recording.folder), *SMALL, *ANY_PORT])
    finally:
        guard.cancel()
    assert not waited.is_set()


def test_a_browser_is_started_without_the_token(tmp_path, monkeypatch, capsys):
    started = []
    monkeypatch.setattr("render.live_cli.has_desktop", lambda: True)
    monkeypatch.setattr("render.live_cli.webbrowser.open", started.append)
    recording = make_recording(tmp_path / "r")
    watched = [each for each in SMALL if each != "--headless"]
    assert not fishlight("live", recording.folder, "--once", *watched, *ANY_PORT)
    base, _, token = capsys.readouterr().out.splitlines()[0].partition("?token=")
    assert started[0].startswith(f"{base}?ticket=")
    assert token not in started[0]


def test_a_camera_that_is_not_there_is_one_line(tmp_path, capsys):
    assert fishlight("live", tmp_path / "nothing", *SMALL, *ANY_PORT) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "nothing" in line
