"""A new recording in the place of another, and what a writer that fails leaves there."""

import json
from pathlib import Path

import pytest

from capture.errors import InputError
from capture.frame import Exposure
from capture.manifest import (
    MANIFEST_NAME,
)
from capture.recording_writer import create_recording
from tests.capture.recorded import SENSOR, noise, record, tree


def test_an_exception_leaves_nothing(tmp_path):
    def write() -> None:
        with create_recording(tmp_path / "r", "", SENSOR) as writer:
            writer.write_frame(noise(), Exposure(1.0), 0.0, 0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("older", [False, True])
def test_a_writer_that_cannot_begin_leaves_nothing(tmp_path, monkeypatch, older):
    if older:
        record(tmp_path / "r", [noise()])
    before = tree(tmp_path)

    def fail(*_: object) -> None:
        raise InputError("the disk is full")

    monkeypatch.setattr("capture.recording_writer.write_manifest", fail)
    with pytest.raises(InputError, match="full"):
        create_recording(tmp_path / "r", "", SENSOR, force=True)
    assert tree(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["r"] * older


def test_a_place_that_takes_no_folder_is_named():
    with pytest.raises(InputError, match="/proc/r: cannot be made"):
        create_recording(Path("/proc/r"), "", SENSOR)


def test_an_older_recording_is_replaced_only_by_force_and_only_when_complete(tmp_path):
    record(tmp_path / "r", [noise()] * 3)
    (tmp_path / "r" / "frames" / "extra").write_text("of the older one")
    older = tree(tmp_path / "r")
    with pytest.raises(InputError, match="--force"):
        record(tmp_path / "r", [noise()])
    with create_recording(tmp_path / "r", "", SENSOR, force=True) as writer:
        writer.write_frame(noise(), Exposure(1.0), 0.0, 0)
        assert tree(tmp_path / "r") == older
    assert [path.name for path in tmp_path.iterdir()] == ["r"]
    assert sorted(tree(tmp_path / "r")) == ["frames/000000.png", MANIFEST_NAME]


def test_an_exception_keeps_the_older_recording(tmp_path):
    record(tmp_path / "r", [noise()] * 3)
    older = tree(tmp_path)

    def write() -> None:
        with create_recording(tmp_path / "r", "", SENSOR, force=True) as writer:
            writer.write_frame(noise(), Exposure(1.0), 0.0, 0)
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write()
    assert tree(tmp_path) == older


def fill_with_results(folder: Path) -> None:
    (folder / "thesis.txt").write_text("three years of work")


def fill_with_foreign_manifest(folder: Path) -> None:
    (folder / MANIFEST_NAME).write_text(json.dumps({"name": "a web page", "icons": []}))


@pytest.mark.parametrize("fill", [fill_with_results, fill_with_foreign_manifest])
def test_force_leaves_alone_what_is_no_recording(tmp_path, fill):
    folder = tmp_path / "precious"
    folder.mkdir()
    fill(folder)
    before = tree(tmp_path)
    with pytest.raises(InputError, match="left alone"):
        create_recording(folder, "", SENSOR, force=True)
    assert tree(tmp_path) == before


@pytest.mark.parametrize("text", ["", "[1, 2]", "{", "[" * 100_000])
def test_a_calibration_that_is_no_json_object_is_refused_before_anything_is_made(tmp_path, text):
    calibration = tmp_path / "cal.json"
    calibration.write_text(text)
    with pytest.raises(InputError, match=r"cal\.json"):
        create_recording(tmp_path / "r", "", SENSOR, calibration=calibration)
    assert not (tmp_path / "r").exists()
