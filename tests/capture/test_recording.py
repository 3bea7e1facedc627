"""Recordings: what was written comes back, and what was damaged is told."""

import hashlib
import os
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from capture.camera_files import read_camera_file
from capture.errors import InputError, UnreadableFrame
from capture.frame import Bracket, Exposure
from capture.manifest import (
    JOURNAL_NAME,
    MANIFEST_NAME,
    MAX_BYTES,
    MOST_FRAMES,
    FrameRecord,
    read_manifest,
    write_manifest,
)
from capture.radiance_files import HDR_SUFFIXES, write_hdr
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import Sensor
from tests.capture.dng_files import dng
from tests.capture.recorded import SENSOR, noise, record


def test_a_recording_never_grows_beyond_what_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr("capture.recording_writer.MOST_FRAMES", 2)
    with create_recording(tmp_path / "r", "", SENSOR) as writer:
        for bracket in range(2):
            writer.write_frame(noise(), Exposure(0.01), 0.0, bracket)
        with pytest.raises(InputError, match="r holds 2 frames"):
            writer.write_frame(noise(), Exposure(0.01), 0.0, 2)
    assert len(list(open_recording(tmp_path / "r"))) == 2
    third = 1 / 3
    longest = FrameRecord(
        file=f"frames/{MOST_FRAMES}.jpeg",
        time_s=third * 1e-8,
        sha256="0" * 64,
        size_px=(16384, 16384),
        index=2 * MOST_FRAMES,
        bracket=MOST_FRAMES,
        timestamp_s=1e9 + third,
        gain=third,
        f_number=10 * third,
        sequence=2**32,
    )
    manifest = msgspec.structs.replace(read_manifest(tmp_path / "r"), frames=(longest,) * 100)
    write_manifest(tmp_path / "r", manifest)
    assert (tmp_path / "r" / MANIFEST_NAME).stat().st_size / 100 * MOST_FRAMES < 0.9 * MAX_BYTES


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_counts_come_back_to_the_bit_with_their_exposures(tmp_path, dtype):
    pictures = [noise(dtype) for _ in range(6)]
    recording = record(tmp_path / "r", pictures, times_s=(0.1, 0.01))
    assert len(recording) == 3
    brackets = list(recording)
    frames = [frame for bracket in brackets for frame in bracket.frames]
    assert [bracket.index for bracket in brackets] == [0, 1, 2]
    assert all(np.array_equal(f.counts, p) for f, p in zip(frames, pictures, strict=True))
    assert [frame.exposure for frame in frames[:2]] == [
        Exposure(0.1, 2.0, 5.6),
        Exposure(0.01, 2.0, 5.6),
    ]
    assert [frame.timestamp_s for frame in frames] == pytest.approx(np.arange(6) / 10)
    assert recording.size_px == (8, 6)
    assert recording.bracket_timestamps_s == pytest.approx((0.0, 0.2, 0.4))


def test_header_and_calibration_come_back(tmp_path):
    calibration = tmp_path / "cal.json"
    calibration.write_text('{"model": "equidistant"}')
    sensor = Sensor(64.0, 1023.0, read_noise_e=2.5, source="data sheet")
    with create_recording(
        tmp_path / "r", "maker model", sensor, calibration=calibration, source="a", licence="CC0"
    ) as writer:
        writer.write_frame(noise(), Exposure(1.0), 0.0, 0)
    recording = open_recording(tmp_path / "r")
    assert vars(recording.sensor) == vars(sensor)
    assert recording.manifest.camera == "maker model"
    assert (recording.manifest.source, recording.manifest.licence) == ("a", "CC0")
    assert recording.calibration_path is not None
    assert recording.calibration_path.read_bytes() == calibration.read_bytes()


def test_encoded_files_keep_their_bytes(tmp_path):
    encoded = cv2.imencode(".jpg", noise())[1].tobytes()
    with create_recording(tmp_path / "r", "", SENSOR) as writer:
        writer.write_encoded(encoded, ".JPG", (8, 6), Exposure(1.0), 0.0, 0)
        writer.write_frame(noise(), Exposure(1.0), 0.0, 1, jpeg_quality=90)
    recording = open_recording(tmp_path / "r")
    first, second = (tmp_path / "r" / frames[0].file for frames in recording.brackets)
    assert first.read_bytes() == encoded
    assert second.suffix == ".jpg"
    assert all(isinstance(bracket, Bracket) for bracket in recording)


def damage_bytes(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def replace_by_other_size(path: Path) -> None:
    cv2.imwrite(str(path), noise(size=(5, 8)))
    relist(path)


def replace_by_16_bit(path: Path) -> None:
    cv2.imwrite(str(path), noise(np.uint16))
    relist(path)


def cut_short(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])
    relist(path)


def replace_by_text(path: Path) -> None:
    path.write_text("not a picture")
    relist(path)


def replace_by_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def replace_by_link_outside(path: Path) -> None:
    outside = path.parents[2] / "outside.png"
    path.rename(outside)
    path.symlink_to(outside)


def relist(path: Path) -> None:
    """Enter the digest of a changed file into the manifest, as a careless tool would."""
    folder = path.parents[1]
    manifest = read_manifest(folder)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    frames = tuple(
        msgspec.structs.replace(frame, sha256=digest) if path.match(frame.file) else frame
        for frame in manifest.frames
    )
    write_manifest(folder, msgspec.structs.replace(manifest, frames=frames))


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (Path.unlink, "no such file"),
        (damage_bytes, "SHA-256"),
        (replace_by_other_size, "8×5 px"),
        (replace_by_16_bit, "uint16"),
        (cut_short, "truncated"),
        (replace_by_text, "000002.png"),
        (replace_by_pipe, "not a regular file"),
        (replace_by_link_outside, "leaves"),
    ],
)
def test_one_bad_frame_costs_its_bracket_and_is_named(tmp_path, damage, told):
    record(tmp_path / "r", [noise() for _ in range(6)], times_s=(0.1, 0.01))
    damage(tmp_path / "r" / "frames" / "000002.png")
    recording = open_recording(tmp_path / "r")
    before, failure, after = recording
    assert isinstance(before, Bracket)
    assert isinstance(after, Bracket)
    assert isinstance(failure, UnreadableFrame)
    assert told in str(failure)
    assert "\n" not in str(failure)
    with pytest.raises(UnreadableFrame, match=told):
        recording.read_bracket(1)


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".exr", ".hdr", ".dng"])
def test_a_frame_that_was_recorded_cut_short_costs_its_bracket(tmp_path, suffix):
    picture = tmp_path / f"whole{suffix}"
    if suffix == ".dng":
        picture.write_bytes(dng(np.full((24, 32), 3000)))
    elif suffix in HDR_SUFFIXES:
        write_hdr(picture, noise() / np.float32(64))
    else:
        cv2.imwrite(str(picture), noise())
    counts = read_camera_file(picture).counts
    size_px = (counts.shape[1], counts.shape[0])
    sensor = read_camera_file(picture).sensor()
    whole = picture.read_bytes()
    with create_recording(tmp_path / "r", "", sensor) as writer:
        for index, content in enumerate([whole, whole[:-40], whole]):
            writer.write_encoded(content, suffix, size_px, Exposure(1.0), float(index), index)
    before, failure, after = open_recording(tmp_path / "r")
    np.testing.assert_array_equal(before.frames[0].counts, counts)
    np.testing.assert_array_equal(after.frames[0].counts, counts)
    assert isinstance(failure, UnreadableFrame)
    assert f"000001{suffix}" in str(failure)


def test_a_bracket_of_another_size_than_the_rest_is_unreadable(tmp_path):
    pictures = [noise(), noise(size=(5, 8)), noise()]
    _, failure, _ = record(tmp_path / "r", pictures)
    assert isinstance(failure, UnreadableFrame)
    assert "8×5" in str(failure)


def change_sensor(folder: Path, **changed: object) -> None:
    manifest = read_manifest(folder)
    sensor = msgspec.structs.replace(manifest.sensor, **changed)
    write_manifest(folder, msgspec.structs.replace(manifest, sensor=sensor))


def test_a_sensor_that_cannot_be_used_is_told_with_its_file(tmp_path):
    record(tmp_path / "r", [noise()])
    change_sensor(tmp_path / "r", black_dn=250.0)  # where its response, sRGB, is 0.96
    with pytest.raises(InputError, match=r"manifest\.json: the sensor .* from 0 at black"):
        open_recording(tmp_path / "r")


def test_counts_that_cannot_be_the_sensors_are_unreadable(tmp_path):
    record(tmp_path / "r", [noise(np.uint16)])
    change_sensor(tmp_path / "r", white_dn=255.0)
    (failure,) = open_recording(tmp_path / "r")
    assert isinstance(failure, UnreadableFrame)
    assert "16-bit counts, but their sensor (assumed linear) is white at 255" in str(failure)


def test_timestamps_that_fall_are_raised_and_counted(tmp_path):
    recording = record(tmp_path / "r", [noise()] * 5, timestamps_s=[0.0, 2.0, 1.0, 1.5, 3.0])
    assert recording.bracket_timestamps_s == (0.0, 2.0, 2.0, 2.0, 3.0)
    assert recording.raised_timestamp_count == 2


def test_a_gap_in_the_index_stays(tmp_path):
    with create_recording(tmp_path / "r", "", SENSOR) as writer:
        for bracket, index in enumerate((3, 4, 9)):
            writer.write_frame(noise(), Exposure(1.0), 0.0, bracket, index=index)
    recording = open_recording(tmp_path / "r")
    assert [bracket.frames[0].index for bracket in recording] == [3, 4, 9]


@pytest.mark.parametrize(
    ("index", "bracket", "timestamp_s"), [(1, 1, 0.0), (2, 0, 0.0), (2, 1, float("nan"))]
)
def test_the_writer_refuses_what_the_reader_would(tmp_path, index, bracket, timestamp_s):
    def write() -> None:
        with create_recording(tmp_path / "r", "", SENSOR) as writer:
            writer.write_frame(noise(), Exposure(1.0), 0.0, 1, index=1)
            writer.write_frame(noise(), Exposure(1.0), timestamp_s, bracket, index=index)

    with pytest.raises(ValueError, match=r"comes after|finite"):
        write()


def test_an_empty_recording_says_so(tmp_path):
    with pytest.raises(InputError, match="no frames"):
        record(tmp_path / "r", [])


def test_a_frame_costs_one_line_however_long_the_recording_is(tmp_path):
    with create_recording(tmp_path / "r", "", SENSOR) as writer:
        header = (tmp_path / "r" / MANIFEST_NAME).stat()
        sizes = [0]
        for index in range(20):
            writer.write_frame(noise(), Exposure(1.0), 0.0, index)
            sizes.append((tmp_path / "r" / JOURNAL_NAME).stat().st_size)
        assert (tmp_path / "r" / MANIFEST_NAME).stat().st_ino == header.st_ino
    grown = np.diff(sizes)
    assert grown.max() - grown.min() <= 10  # digits of index and file name
    assert not (tmp_path / "r" / JOURNAL_NAME).exists()


def test_a_recording_being_written_can_be_read(tmp_path):
    with create_recording(tmp_path / "r", "", SENSOR) as writer:
        for count in range(1, 4):
            writer.write_frame(noise(), Exposure(1.0), 0.0, count)
            recording = open_recording(tmp_path / "r")
            assert [type(bracket) for bracket in recording] == [Bracket] * count
