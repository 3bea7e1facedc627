"""Recordings: what was written comes back, whatever happens to the writer or to the folder."""

import hashlib
import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

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
from capture.recording import Recording, contained_file, open_recording
from capture.recording_writer import create_recording
from capture.sensor import Sensor, assumed_sensor
from tests.capture.dng_files import dng

ROOT = Path(__file__).resolve().parents[2]
SENSOR = assumed_sensor(np.uint8)
RNG = np.random.default_rng(7)


def noise(dtype=np.uint8, size=(6, 8)):
    return RNG.integers(0, np.iinfo(dtype).max, (*size, 3), dtype, endpoint=True)


def record(folder: Path, pictures, times_s=(0.01,), timestamps_s=None, **options) -> Recording:
    """Write pictures as brackets of `times_s` and open the result."""
    sensor = assumed_sensor(pictures[0].dtype) if pictures else SENSOR
    with create_recording(folder, "test camera", sensor, **options) as writer:
        for index, picture in enumerate(pictures):
            timestamp_s = index / 10 if timestamps_s is None else timestamps_s[index]
            exposure = Exposure(times_s[index % len(times_s)], 2.0, 5.6)
            writer.write_frame(picture, exposure, timestamp_s, index // len(times_s))
    return open_recording(folder)


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


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


KILLED_WRITER = """
import os, random, signal, sys, time
from pathlib import Path

import numpy as np

from capture.frame import Exposure
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor

picture = np.full((6, 8, 3), 7, np.uint8)


def write(folder, count, force):
    with create_recording(folder, "", assumed_sensor(np.uint8), force=force) as writer:
        for index in range(count):
            writer.write_frame(picture, Exposure(1.0), float(index), index)
            os.write(progress, b".")


def killed_at_event(number):
    seen = 0

    def hook(event, arguments):
        nonlocal seen
        if event == "open" or event.startswith(("os.", "shutil.", "tempfile.")):
            seen += 1
            if seen == number:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


def run(folder, count, force, number):
    child = os.fork()
    if child == 0:
        killed_at_event(number)
        write(folder, count, force)
        os._exit(0)
    return child


root, mode = Path(sys.argv[1]), sys.argv[2]
ended, number = False, 0
while not ended:
    number += 1
    place = root / str(number)
    place.mkdir()
    progress = os.open(place / "progress", os.O_WRONLY | os.O_CREAT)
    if mode == "replace":
        write(place / "r", 2, False)
    if mode == "random":
        child = run(place / "r", 10**6, False, 0)
        chance = random.Random(number)
        finished_count = chance.randrange(1, 20)
        while os.fstat(progress).st_size < finished_count:
            time.sleep(0.001)
        time.sleep(chance.uniform(0.0, 0.01))
        os.kill(child, signal.SIGKILL)
    else:
        child = run(place / "r", 3, mode == "replace", number)
    _, status = os.waitpid(child, 0)
    os.close(progress)
    ended = number == 12 if mode == "random" else os.WIFEXITED(status)
"""


def killed_at_every_point(root: Path, mode: str) -> list[Path]:
    """Return the places where a writer was killed, each at a later system call."""
    subprocess.run(
        [sys.executable, "-c", textwrap.dedent(KILLED_WRITER), str(root), mode],
        check=True,
        cwd=ROOT,
        timeout=120,
    )
    return sorted(root.iterdir(), key=lambda place: int(place.name))


@pytest.mark.parametrize("mode", ["new", "random"])
def test_a_killed_writer_leaves_every_frame_it_had_finished(tmp_path, mode):
    places = killed_at_every_point(tmp_path, mode)
    assert len(places) >= 12
    counts = []
    for place in places:
        finished_count = (place / "progress").stat().st_size
        try:
            recording = open_recording(place / "r")
        except InputError:
            # Killed before there was anything to read.
            assert finished_count == 0
            continue
        brackets = list(recording)
        assert all(isinstance(bracket, Bracket) for bracket in brackets)
        assert len(brackets) in (finished_count, finished_count + 1)
        counts.append(len(brackets))
    if mode == "new":
        assert counts == sorted(counts)
        assert set(counts) == {1, 2, 3}
    else:
        assert max(counts) > 10


def test_a_writer_killed_while_it_replaces_leaves_the_old_or_the_new_recording_whole(tmp_path):
    found = set()
    for place in killed_at_every_point(tmp_path, "replace"):
        if (place / "r").exists():
            found.add(len(list(open_recording(place / "r"))))
        else:
            # Between the two renames both are whole, under their other names.
            lengths = {len(open_recording(path)) for path in place.glob(".*-r-*")}
            assert lengths == {2, 3}
    assert found == {2, 3}


@pytest.fixture(scope="module")
def folder_with_traps(tmp_path_factory):
    place = tmp_path_factory.mktemp("traps")
    folder = place / "recording"
    (folder / "frames").mkdir(parents=True)
    (folder / "frames" / "a").write_text("inside")
    (place / "secret").write_text("outside")
    (folder / "frames" / "out").symlink_to(place / "secret")
    (folder / "up").symlink_to(place)
    (folder / "in").symlink_to(folder / "frames")
    (folder / "loop").symlink_to(folder / "loop")
    os.mkfifo(folder / "pipe")
    return folder


PARTS = st.sampled_from(
    ["..", ".", "", "frames", "a", "out", "up", "in", "loop", "pipe", "secret", "recording", "\0"]
)


@given(name=st.one_of(st.lists(PARTS, max_size=5).map("/".join), st.text(max_size=20)))
@example(name="in/a")
@example(name="up/secret")
@example(name="frames/out")
@example(name="/dev/zero")
@example(name="\ud800")
@example(name="a" * 5000)
@settings(max_examples=300, deadline=None)
def test_no_path_leaves_the_folder(folder_with_traps, name):
    try:
        path = contained_file(folder_with_traps, name)
    except InputError as refusal:
        told = str(refusal)
    else:
        told = ""
        assert Path(os.path.realpath(path)).read_text() == "inside"
    assert "\n" not in told


def test_a_link_that_stays_inside_is_followed(folder_with_traps):
    assert contained_file(folder_with_traps, "in/a").read_text() == "inside"
