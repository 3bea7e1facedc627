"""Imports: files keep their bytes, doubts are told, and what does not fit leaves nothing."""

import hashlib

import av
import cv2
import numpy as np
import pytest

from capture.errors import InputError, UnreadableFrame
from capture.frame import Bracket, Exposure
from capture.importing import import_sources, read_photo_bracket
from capture.merge import merge_bracket
from capture.radiance_files import write_hdr
from capture.sensor import assumed_sensor
from capture.video import VideoFrame
from tests.capture.photo_files import DATA, scene_picture, write_photograph


def write_bracket(folder, times_s=(0.4, 0.1, 0.025), repetitions=1):
    folder.mkdir(exist_ok=True)
    return [
        write_photograph(folder / f"{index}.jpg", time_s)
        for index, time_s in enumerate(times_s * repetitions)
    ]


def test_photographs_become_brackets_and_keep_their_bytes(tmp_path):
    paths = write_bracket(tmp_path / "photos", repetitions=2)
    calibration = tmp_path / "cal.json"
    calibration.write_text("{}")
    imported = import_sources(
        [tmp_path / "photos"], tmp_path / "r", calibration=calibration, licence="CC0"
    )
    recording = imported.recording
    assert [len(frames) for frames in recording.brackets] == [3, 3]
    records = recording.manifest.frames
    for path, record in zip(paths, records, strict=True):
        data = (tmp_path / "r" / record.file).read_bytes()
        assert data == path.read_bytes()
        assert hashlib.sha256(data).hexdigest() == record.sha256
    assert recording.manifest.camera == "Test 1"
    assert recording.manifest.source == "photos"
    assert recording.manifest.licence == "CC0"
    assert recording.calibration_path is not None
    assert recording.sensor.source == "assumed sRGB"
    assert imported.notes == ("no usable capture times: brackets are put 1 s apart",)
    assert all(isinstance(bracket, Bracket) for bracket in recording)


def test_a_16_bit_picture_stays_16_bit(tmp_path):
    picture = np.random.default_rng(1).integers(0, 65536, (8, 9, 3), np.uint16)
    cv2.imwrite(str(tmp_path / "a.png"), picture[..., ::-1])
    recording = import_sources([tmp_path / "a.png"], tmp_path / "r", exposures_s=[1.0]).recording
    assert np.array_equal(recording.read_bracket(0).frames[0].counts, picture)
    assert recording.sensor.white_dn == 65535


def truncated(paths):
    paths[-1].write_bytes(paths[-1].read_bytes()[:-200])


def of_other_size(paths):
    write_photograph(paths[-1], 0.025, picture=scene_picture(0.025, (32, 32)))


def same_exposure_other_light(paths):
    write_photograph(paths[-1], 0.1, picture=scene_picture(0.15))


def swapped(paths):
    write_photograph(paths[0], 0.4, picture=scene_picture(0.025))
    write_photograph(paths[-1], 0.025, picture=scene_picture(0.4))


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (truncated, r"2\.jpg"),
        (of_other_size, r"2\.jpg \(32×32 px"),
        (same_exposure_other_light, r"1\.jpg and 2\.jpg have the same exposure.*--exposures"),
        (swapped, r"EV apart.*--exposures"),
    ],
)
def test_photographs_that_do_not_fit_are_refused_and_nothing_is_written(tmp_path, spoil, told):
    paths = write_bracket(tmp_path / "photos")
    spoil(paths)
    for door in (
        lambda: import_sources(paths, tmp_path / "r"),
        lambda: read_photo_bracket(paths),
    ):
        with pytest.raises(InputError, match=told) as caught:
            door()
        assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


@pytest.mark.parametrize("time_s", [None, 0.0])
def test_an_exposure_that_cannot_be_is_told_before_any_pixel_is_read(tmp_path, monkeypatch, time_s):
    paths = write_bracket(tmp_path / "photos")
    write_photograph(paths[1], time_s)
    monkeypatch.setattr("capture.importing.read_camera_file", None)  # decoding would be an error
    with pytest.raises(InputError, match=r"1\.jpg.*--exposures"):
        read_photo_bracket(paths)


def test_a_size_that_changes_between_brackets_is_refused(tmp_path):
    paths = write_bracket(tmp_path / "photos", times_s=(0.1,), repetitions=3)
    write_photograph(paths[1], 0.1, picture=scene_picture(0.1, (32, 32)))
    with pytest.raises(InputError, match=r"1\.jpg \(32×32 px"):
        import_sources(paths, tmp_path / "r")


def test_repeats_that_agree_are_let_in(tmp_path):
    rng = np.random.default_rng(2)
    for name, time_s in (("a", 0.1), ("b", 0.1), ("c", 0.025)):
        noisy = scene_picture(time_s) + rng.normal(0, 5, (32, 48, 3))
        picture = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
        write_photograph(tmp_path / f"{name}.jpg", time_s, picture=picture)
    bracket, _, _ = read_photo_bracket([tmp_path])
    assert len(bracket.frames) == 3


def test_repeats_from_the_hand_are_let_in_and_other_light_is_not(tmp_path):
    """Compared place by place, what has moved would differ by more than a third of a stop does."""
    tiles = np.random.default_rng(3).uniform(10, 200, (20, 30, 3)).repeat(10, 0).repeat(10, 1)
    still, moved = tiles[:180, :280], tiles[6:186, 8:288]
    for name, picture in (("a", still), ("b", moved), ("c", 0.895 * moved)):
        picture = picture.astype(np.uint8)
        write_photograph(tmp_path / f"{name}.jpg", 0.1, picture=picture)
    bracket, _, _ = read_photo_bracket([tmp_path / "a.jpg", tmp_path / "b.jpg"], [0.1, 0.1])
    assert len(bracket.frames) == 2
    with pytest.raises(InputError, match=r"a\.jpg and c\.jpg have the same exposure .* by 1[0-3]%"):
        read_photo_bracket([tmp_path / "a.jpg", tmp_path / "c.jpg"], [0.1, 0.1])


def test_given_exposures_are_believed_against_the_pixels(tmp_path):
    paths = write_bracket(tmp_path / "photos")
    bracket, _, notes = read_photo_bracket(paths, [0.025, 0.1, 0.4])
    assert bracket.frames[0].exposure == Exposure(0.025)
    assert "EV apart" in notes[-1]


def test_one_of_several_brackets_is_chosen(tmp_path):
    paths = write_bracket(tmp_path / "photos", repetitions=2)
    bracket, sensor, notes = read_photo_bracket(paths, position=1)
    assert "the photographs form 2 brackets, from 0 on; this is 1" in notes
    assert bracket.index == 1
    assert len(bracket.frames) == 3
    assert sensor.white_dn == 255
    for position in (2, -1):
        with pytest.raises(InputError, match="form 2"):
            read_photo_bracket(paths, position=position)


def test_a_clipped_mark_travels_from_an_exr_to_the_radiance(tmp_path):
    clipped = np.zeros((4, 6), bool)
    clipped[1, 2] = True
    write_hdr(tmp_path / "a1.exr", np.ones((4, 6, 3), np.float32), clipped=clipped)
    recording = import_sources([tmp_path / "a1.exr"], tmp_path / "r").recording
    image = merge_bracket(recording.read_bracket(0), recording.sensor)
    np.testing.assert_array_equal(image.clipped, clipped)
    bracket, sensor, _ = read_photo_bracket([tmp_path / "a1.exr"])
    np.testing.assert_array_equal(merge_bracket(bracket, sensor).clipped, clipped)


def test_an_exr_sequence_is_copied_and_gives_its_radiance(tmp_path):
    radiance = np.random.default_rng(4).uniform(0, 1e5, (2, 6, 8, 3)).astype(np.float32)
    valid = np.ones((6, 8), bool)
    valid[2, 3] = False
    write_hdr(tmp_path / "a1.exr", radiance[0], valid=valid)
    write_hdr(tmp_path / "a2.exr", radiance[1])
    recording = import_sources([tmp_path], tmp_path / "r").recording
    assert [len(frames) for frames in recording.brackets] == [1, 1]
    first, second = (recording.read_bracket(i).frames[0] for i in range(2))
    assert first.exposure == Exposure(1.0)
    assert np.array_equal(second.counts, radiance[1])
    assert np.isnan(first.counts[2, 3]).all()
    assert np.array_equal(first.counts[valid], radiance[0][valid])
    record = recording.manifest.frames[0]
    assert (tmp_path / "r" / record.file).read_bytes() == (tmp_path / "a1.exr").read_bytes()


def write_video(path, frame_count):
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 32, 32, "bgr0"
        for index in range(frame_count):
            picture = np.full((32, 32, 3), 10 * index, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def test_a_video_becomes_a_bracket_per_frame(tmp_path):
    video = write_video(tmp_path / "v.mkv", 5)
    imported = import_sources([video], tmp_path / "r", exposures_s=[1 / 30])
    assert imported.notes == ()
    brackets = list(imported.recording)
    assert [bracket.frames[0].counts[0, 0, 0] for bracket in brackets] == [0, 10, 20, 30, 40]
    assert brackets[4].timestamp_s == pytest.approx(0.16, abs=1e-3)
    assert {bracket.frames[0].exposure for bracket in brackets} == {Exposure(1 / 30)}


def test_a_video_without_exposure_time_says_what_is_assumed(tmp_path):
    imported = import_sources([write_video(tmp_path / "v.mkv", 1)], tmp_path / "r")
    assert imported.notes == ("a video tells no exposure time: 1 s is assumed",)


def test_frames_of_a_video_that_cannot_be_decoded_leave_a_gap_and_a_note(tmp_path, monkeypatch):
    frames = [VideoFrame(np.zeros((8, 8, 3), np.uint8), i / 25, i) for i in (0, 1, 4, 5)]
    monkeypatch.setattr("capture.importing.read_video", lambda _path: iter(frames))
    imported = import_sources([tmp_path / "v.mkv"], tmp_path / "r", exposures_s=[1.0])
    assert [frame.index for frame in imported.recording.manifest.frames] == [0, 1, 4, 5]
    assert [frame.bracket for frame in imported.recording.manifest.frames] == [0, 1, 2, 3]
    assert imported.notes == ("frames that could not be decoded, and are left out: 2",)


def test_a_video_cannot_be_a_bracket(tmp_path):
    video = write_video(tmp_path / "v.mkv", 2)
    with pytest.raises(InputError, match="one exposure time, 2 were given"):
        import_sources([video], tmp_path / "r", exposures_s=[1.0, 2.0])
    with pytest.raises(InputError, match="alone"):
        import_sources([video, video], tmp_path / "r")


def test_a_video_is_not_given_a_response_of_other_counts(tmp_path):
    video = write_video(tmp_path / "v.mkv", 1)
    with pytest.raises(InputError, match="8-bit counts"):
        import_sources([video], tmp_path / "r", sensor=assumed_sensor(np.uint16))
    assert not (tmp_path / "r").exists()


def test_a_video_that_cannot_be_read_leaves_nothing(tmp_path):
    (tmp_path / "v.mp4").write_text("no video")
    with pytest.raises(UnreadableFrame):
        import_sources([tmp_path / "v.mp4"], tmp_path / "r")
    assert not (tmp_path / "r").exists()


def test_an_existing_output_is_refused_before_the_work(tmp_path, monkeypatch):
    import_sources(write_bracket(tmp_path / "photos"), tmp_path / "r")
    monkeypatch.setattr("capture.importing.read_camera_file", None)  # decoding would be an error
    with pytest.raises(InputError, match="--force"):
        import_sources([tmp_path / "photos"], tmp_path / "r")


def test_nothing_to_import_is_said(tmp_path):
    with pytest.raises(InputError, match="nothing to import"):
        import_sources([], tmp_path / "r")


@pytest.mark.parametrize("name", ["source", "licence"])
def test_text_that_would_steer_a_terminal_is_refused(tmp_path, name):
    paths = write_bracket(tmp_path / "photos")
    with pytest.raises(InputError, match=rf"--{name} 'a\\x1b\[2J' is not text in one line"):
        import_sources(paths, tmp_path / "r", **{name: "a\x1b[2J"})
    assert not (tmp_path / "r").exists()


def test_names_of_files_are_noted_without_what_steers_a_terminal(tmp_path):
    path = write_photograph(tmp_path / "a\x1b[2J.jpg", 0.1)
    assert import_sources([path], tmp_path / "r").recording.manifest.source == "a[2J.jpg"


@pytest.mark.data
@pytest.mark.parametrize(
    ("names", "exposures_s", "size_px"),
    [
        (("brackets-lumilab-fisheye/JPEG/IMG_6955.JPG",), None, (5616, 3744)),
        (("brackets-bigchou/exp/ex_1/DSCF6014.jpg",), None, (1500, 1000)),
        (
            ("brackets-memorial/memorial0061.png", "brackets-memorial/memorial0067.png"),
            [32.0, 0.5],
            (512, 768),
        ),
        (("seq-vali-sky/src/webapp/public/example-sky-images",), [1.0], (880, 880)),
        (("seq-stanford-skippd/sunny_day_demo_1.gif",), None, (64, 64)),
        (("raw-tinydng/colorchart.dng",), [0.1], (1734, 1156)),
    ],
)
def test_real_files_are_imported_and_read_back(tmp_path, names, exposures_s, size_px):
    paths = [DATA / name for name in names]
    if not all(path.exists() for path in paths):
        pytest.skip(f"{names[0]} is not at hand")
    recording = import_sources(paths, tmp_path / "r", exposures_s=exposures_s).recording
    assert recording.size_px == size_px
    assert all(isinstance(bracket, Bracket) for bracket in recording)
