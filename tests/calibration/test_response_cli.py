"""`fishlight calibrate response`, as a shell calls it."""

import json
from typing import Any

import numpy as np
import pytest

from capture.errors import InputError
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor
from tests.calibration.response_scenes import bracket
from tests.capture import command_line


def run(*tokens: Any) -> None:
    command_line.run("calibrate", "response", *tokens)


@pytest.fixture
def recording(tmp_path):
    with create_recording(tmp_path / "r", "a camera", assumed_sensor(np.uint8)) as writer:
        for number in range(2):
            for frame in bracket("film", number).frames:
                writer.write_frame(frame.counts, frame.exposure, float(number), number)
    return tmp_path / "r"


def test_without_a_place_for_it_the_response_is_only_told(recording, capsys):
    before = (recording / "manifest.json").read_bytes()
    run(recording)
    assert "of 2 brackets; neighbouring exposures differ by 0.0" in capsys.readouterr().out
    assert (recording / "manifest.json").read_bytes() == before


def test_applied_it_is_in_the_recording_and_written_it_is_the_same(recording, tmp_path, capsys):
    frames = open_recording(recording).manifest.frames
    run(recording, "--apply", "-o", tmp_path / "response.json", "--brackets", 1)
    assert "of 1 brackets" in capsys.readouterr().out
    opened = open_recording(recording)
    assert opened.manifest.frames == frames
    assert opened.sensor.source.startswith("response estimated (monotone")
    written = json.loads((tmp_path / "response.json").read_text())
    assert written["schema"] == "fishlight-response/1"
    assert np.array_equal(written["sensor"]["response"], opened.sensor.response)
    assert np.array_equal(written["sensor"]["response_deviation"], opened.sensor.response_deviation)
    assert written["held_out_ev"] < written["assumed_ev"]


def test_corrections_of_exposures_are_told(recording, capsys):
    run(recording, "--exposure-tolerance-ev", "0.05", "--brackets", 1)
    assert "exposures corrected by" in capsys.readouterr().out


def test_a_file_is_replaced_only_when_told_and_refused_before_the_work(recording, tmp_path):
    (tmp_path / "response.json").write_text("mine")
    with pytest.raises(InputError, match="give --force"):
        run(recording, "-o", tmp_path / "response.json")
    assert (tmp_path / "response.json").read_text() == "mine"


def test_a_bracket_that_cannot_be_read_is_left_out(recording, capsys):
    (recording / "frames" / "000000.png").unlink()
    run(recording)
    told = capsys.readouterr()
    assert "note: left out" in told.err
    assert "of 1 brackets" in told.out
    (recording / "frames" / "000005.png").unlink()
    with pytest.raises(InputError, match="000005"):
        run(recording)


def test_what_is_refused_names_the_recording(recording):
    with pytest.raises(InputError, match=f"{recording}: the method must be one of"):
        run(recording, "--method", "guess")
    with pytest.raises(InputError, match="--brackets must be 1 or more"):
        run(recording, "--brackets", 0)
