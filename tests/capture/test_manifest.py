"""manifest.json: what is refused, and that nothing is lost on the way through it."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import capture.manifest
from capture.errors import InputError
from capture.manifest import (
    JOURNAL_NAME,
    MANIFEST_NAME,
    SCHEMA,
    FrameRecord,
    Manifest,
    check_relative,
    journal_line,
    read_manifest,
    sensor_of,
    sensor_record,
    write_manifest,
)
from capture.sensor import Sensor, assumed_sensor


def record(index: int, **changes: Any) -> FrameRecord:
    values: dict[str, Any] = {
        "file": f"frames/{index}.png",
        "time_s": 0.01,
        "sha256": "0" * 64,
        "size_px": (4, 3),
        "index": index,
        "bracket": index,
    }
    return FrameRecord(**(values | changes))


def manifest(*frames: FrameRecord) -> Manifest:
    return Manifest(
        camera="",
        sensor=sensor_record(assumed_sensor(np.uint8)),
        source="test",
        licence="CC0",
        frames=frames,
    )


def edited(folder: Path, **changes: Any) -> None:
    """Write a manifest of one frame in which top-level values, or those of the frame, differ."""
    write_manifest(folder, manifest(record(0)))
    content = json.loads((folder / MANIFEST_NAME).read_text())
    for name, value in changes.items():
        (content if name in content else content["frames"][0])[name] = value
    (folder / MANIFEST_NAME).write_text(json.dumps(content))


def test_a_manifest_comes_back_as_it_was(tmp_path):
    written = manifest(record(0, gain=2.0, f_number=5.6, timestamp_s=1.25), record(3, bracket=0))
    write_manifest(tmp_path, written)
    assert read_manifest(tmp_path) == written


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"schema": "fishlight-recording/2"}, "fishlight-recording/2"),
        ({"schema": "package/1"}, "package/1"),
        ({"time_s": 0}, "time_s"),
        ({"time_s": -1}, "time_s"),
        ({"time_s": float("nan")}, "malformed"),
        ({"timestamp_s": float("inf")}, "malformed"),
        ({"gain": None}, "gain"),
        ({"f_number": "5.6"}, "f_number"),
        ({"sha256": "abc"}, "sha256"),
        ({"size_px": [0, 3]}, "size_px"),
        ({"index": -1}, "index"),
        ({"file": "../secret.png"}, "secret.png"),
        ({"camera": None}, "camera"),
        ({"camera": "\x1b[2J"}, r"\$\.camera"),
        ({"licence": "CC0\nby nobody"}, r"\$\.licence"),
        ({"source": "\x9b2J"}, r"\$\.source"),
        ({"sensor": {}}, "sensor"),
    ],
)
def test_a_wrong_value_is_named_with_its_file(tmp_path, changes, told):
    edited(tmp_path, **changes)
    with pytest.raises(InputError, match=told) as caught:
        read_manifest(tmp_path)
    assert MANIFEST_NAME in str(caught.value) or "secret" in told
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 200_000, '{"schema": 1}', "\udcff"])
def test_what_is_no_manifest_is_refused_in_one_line(tmp_path, text):
    (tmp_path / MANIFEST_NAME).write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError) as caught:
        read_manifest(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_folder_without_one_is_told_how_to_get_one(tmp_path):
    with pytest.raises(InputError, match="fishlight import"):
        read_manifest(tmp_path)


def test_its_size_is_looked_at_before_its_bytes(tmp_path, monkeypatch):
    write_manifest(tmp_path, manifest(record(0)))
    monkeypatch.setattr(capture.manifest, "MAX_BYTES", 100)
    with pytest.raises(InputError, match="more than the 100"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("frames", "told"),
    [
        ((record(0), record(0, file="frames/other.png")), "both have index 0"),
        ((record(0), record(1, file="frames/0.png")), "listed twice"),
        ((record(0, bracket=1), record(1, bracket=0)), "comes after"),
    ],
)
def test_frames_that_contradict_one_another_are_refused(tmp_path, frames, told):
    write_manifest(tmp_path, manifest(*frames))
    with pytest.raises(InputError, match=told):
        read_manifest(tmp_path)


def test_unordered_frames_are_put_in_order(tmp_path):
    write_manifest(tmp_path, manifest(record(2), record(0), record(1)))
    assert [each.index for each in read_manifest(tmp_path).frames] == [0, 1, 2]


def test_a_journal_cut_at_any_byte_gives_its_complete_lines(tmp_path):
    write_manifest(tmp_path, manifest())
    lines = [journal_line(record(index)) for index in range(3)]
    journal = b"".join(lines)
    for length in range(len(journal) + 1):
        (tmp_path / JOURNAL_NAME).write_bytes(journal[:length])
        assert len(read_manifest(tmp_path).frames) == journal[:length].count(b"\n")


def test_a_frame_in_manifest_and_journal_counts_once(tmp_path):
    write_manifest(tmp_path, manifest(record(0), record(1)))
    (tmp_path / JOURNAL_NAME).write_bytes(journal_line(record(1)) + journal_line(record(2)))
    assert [each.index for each in read_manifest(tmp_path).frames] == [0, 1, 2]


def test_a_damaged_complete_line_is_refused(tmp_path):
    write_manifest(tmp_path, manifest())
    (tmp_path / JOURNAL_NAME).write_bytes(journal_line(record(0)) + b"{}\n")
    with pytest.raises(InputError, match="line 2"):
        read_manifest(tmp_path)


@given(
    black=st.floats(0, 500),
    white=st.floats(501, 65535),
    saturation=st.floats(0.01, 1),
    full_well=st.floats(1, 1e6),
    read_noise=st.floats(0, 100),
)
@settings(max_examples=30, deadline=None)
def test_a_linear_sensor_goes_through_without_loss(black, white, saturation, full_well, read_noise):
    sensor = Sensor(black, white, None, saturation, full_well, read_noise, "measured")
    assert vars(sensor_of(sensor_record(sensor))) == vars(sensor)


def test_responses_go_through_without_loss_and_srgb_by_name():
    srgb = assumed_sensor(np.uint8)
    assert sensor_record(srgb).response == "srgb"
    assert srgb.response is not None
    measured = Sensor(0.0, 255.0, response=srgb.response**1.1)
    measured_record = sensor_record(measured)
    assert isinstance(measured_record.response, list)
    for sensor in (srgb, measured):
        assert np.array_equal(sensor_of(sensor_record(sensor)).response, sensor.response)


def test_a_sensor_that_contradicts_itself_is_refused():
    record = sensor_record(Sensor(0.0, 255.0))
    for changed in (
        {"black_dn": 300.0},
        {"response": [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)]},
        {"response": []},
        {"response": [(0.0, 0.0, 0.0)] * 256},
        {"response": [(1.0, 1.0, 1.0)] * 256},
        {"response": [(float(count),) * 3 for count in range(256)]},
        {"black_dn": 254.5},
        {"white_dn": 1e300},
        {"saturation": 1e-4},
        {"full_well_e": 1e-9},
        {"full_well_e": 1e300},
        {"read_noise_e": 1e150},
        {"colour_matrix": [(1.0, 1.0, 1.0)] * 3},
        {"colour_matrix": [(1e300, 0.0, 0.0), (0.0, 1e300, 0.0), (0.0, 0.0, 1e300)]},
    ):
        with pytest.raises(InputError, match="sensor"):
            sensor_of(msgspec.structs.replace(record, **changed))


@pytest.mark.parametrize(
    "name", ["", ".", "/etc/passwd", "..", "a/../b", "a\0b", "a\nb", "\x1b[2J", "..\\b", "./.."]
)
def test_paths_that_may_leave_the_folder_are_refused(name):
    with pytest.raises(InputError, match="relative"):
        check_relative(name)


def test_the_schema_names_the_version():
    # Other programs decide by this text whether they can read a recording.
    assert SCHEMA == "fishlight-recording/1"
