"""What a live session saves: snapshots, exports, recordings, and what cannot be written."""

import resource
from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.recording import open_recording
from lighting.light_files import read_lights
from lighting.maps.environment_files import read_environment
from render.live.desk import Desk
from render.live.results import Results
from render.live.settings import Settings
from tests.render.live_recording import make_recording
from tests.render.live_run import MODELS, run


@pytest.fixture
def recording(tmp_path):
    return make_recording(tmp_path / "r")


def test_snapshot_export_and_recording_can_be_read_again(recording, tmp_path):
    output = tmp_path / "results"

    def before(desk, number):
        for request in {1: ("snapshot", "export-usda", "record"), 4: ("record",)}.get(number, ()):
            desk.ask(request)

    results, said = [], []

    def work(desk, bracket, seen):
        if not results:
            results.append(
                Results(
                    desk, output, "cam", recording.sensor, recording.calibration_path, said.append
                )
            )
        results[0].look_at(bracket, seen)
        results[0]._thread.submit(lambda: None).result()  # what was asked for is done

    ran = run(recording, 6, before=before, work=work)
    with results[0]:
        pass
    assert not ran.desk.notice.is_error
    lights = read_lights(output / "snapshot-0001.json")
    np.testing.assert_array_equal(lights.directions, ran.moments[1].seen.lights.directions)
    environment, _ = read_environment(output / "snapshot-0001.exr")
    np.testing.assert_array_equal(environment.radiance, ran.moments[1].seen.environment.radiance)
    assert (output / "snapshot-0001.png").is_file()
    assert (output / "lights-0001.usda").is_file()
    recorded = open_recording(output / "recording-0001")
    counts = [frame.counts for bracket in recorded for frame in bracket.frames]
    original = [
        recording.read_bracket(number % 3).frames for number in (2, 3)
    ]  # from the next one on
    expected = [frame.counts for frames in original for frame in frames]
    np.testing.assert_array_equal(counts, expected)
    assert not ran.desk.is_recording


def results_of(desk, folder, recording, say):
    return Results(desk, folder, "", recording.sensor, recording.calibration_path, say)


def test_a_result_that_cannot_be_written_is_told_and_the_session_goes_on(recording, tmp_path):
    (tmp_path / "file").write_text("")
    desk, said = Desk(Settings(), MODELS), []
    seen = run(recording, 1).moments[0].seen
    desk.ask("snapshot")
    with results_of(desk, tmp_path / "file/x", recording, said.append) as results:
        results.look_at(recording.read_bracket(0), seen)
    assert desk.notice.is_error
    assert desk.notice.text.startswith("snapshot: ")
    assert said == [desk.notice.text]


def test_a_defect_ends_a_recording_with_its_traceback(recording, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cv2, "imencode", lambda *_: None)
    desk, said = Desk(Settings(count=5), MODELS), []
    seen, bracket = run(recording, 1).moments[0].seen, recording.read_bracket(0)
    desk.ask("record")
    with results_of(desk, tmp_path / "out", recording, said.append) as results:
        for number in range(3):
            results.look_at(replace(bracket, index=number), seen)
            results._thread.submit(lambda: None).result()
        assert not desk.is_recording
    assert "Traceback" in capsys.readouterr().err
    assert desk.notice.text == "record: failed by a defect of fishlight; see the terminal"


def test_a_bracket_that_is_shown_again_is_recorded_once(recording, tmp_path):
    # As a played recording gives one when settings change before the next is due.
    desk, seen = Desk(Settings(count=5), MODELS), run(recording, 1).moments[0].seen
    first, second = recording.read_bracket(0), recording.read_bracket(1)
    desk.ask("record")
    with results_of(desk, tmp_path / "out", recording, lambda _text: None) as results:
        for bracket in (first, first, second, second):
            results.look_at(bracket, seen)
            results._thread.submit(lambda: None).result()
    recorded = open_recording(tmp_path / "out/recording-0001")
    assert [len(each.frames) for each in recorded] == [2, 2]


@pytest.mark.parametrize("limit", [2000, 9750])
def test_a_full_disk_ends_a_recording_and_not_the_session(recording, tmp_path, limit):
    # A limit on the size of a file fails as a full disk does. A frame has 9.4 kB: under the smaller
    # limit none fits, under the larger the journal is full after some, in mid-bracket.
    desk, said = Desk(Settings(count=5), MODELS), []
    seen, bracket = run(recording, 1).moments[0].seen, recording.read_bracket(0)
    older = resource.getrlimit(resource.RLIMIT_FSIZE)
    with results_of(desk, tmp_path / "out", recording, said.append) as results:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, older[1]))
        try:
            desk.ask("record")
            for number in range(40):
                results.look_at(replace(bracket, index=number), seen)
                results._thread.submit(lambda: None).result()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, older)
        assert not desk.is_recording
        assert desk.notice.is_error
        assert "cannot be written (File too large)" in desk.notice.text
        assert "the session goes on" in desk.notice.text
        assert [text.partition(":")[0] for text in said] == [
            f"Recording to {tmp_path}/out/recording-0001",
            "record",
        ]
        desk.ask("snapshot")  # there is room again
        results.look_at(bracket, seen)
    assert not desk.notice.is_error
    written = int(said[1].partition("recording-0001: ")[2].partition(" ")[0])
    assert (written > 5) == (limit > 9000)
    if written:
        recorded = open_recording(tmp_path / "out/recording-0001")
        assert [len(each.frames) for each in recorded] == [2] * written
