"""Video files: exact frames, their times, the right colour matrix, and damage that is counted."""

from fractions import Fraction

import av
import numpy as np
import pytest
from av.video.reformatter import Colorspace

import capture.video
from capture.errors import InputError, UnreadableFrame
from capture.video import read_video
from tests.capture.photo_files import DATA

RNG = np.random.default_rng(3)
COLOUR = (200, 60, 30)


def write_video(path, pictures, codec, pixel_format, *, rate=25, options=None, matrix=None):
    height, width = pictures[0].shape[:2]
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        for index, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame = frame.reformat(format=pixel_format, dst_colorspace=matrix)
            frame.pts, frame.time_base = index, Fraction(1, rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def test_a_lossless_video_gives_its_frames_and_times_exactly(tmp_path):
    pictures = [RNG.integers(0, 256, (32, 48, 3), np.uint8) for _ in range(5)]
    path = write_video(tmp_path / "v.mkv", pictures, "ffv1", "bgr0")
    frames = list(read_video(path))
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4]
    assert [frame.timestamp_s for frame in frames] == pytest.approx(
        [0, 0.04, 0.08, 0.12, 0.16], abs=1e-3
    )  # Matroska counts milliseconds
    for frame, picture in zip(frames, pictures, strict=True):
        assert np.array_equal(frame.counts, picture)


@pytest.mark.parametrize(("height", "matrix"), [(64, Colorspace.ITU601), (720, Colorspace.ITU709)])
def test_a_video_without_a_colour_matrix_is_taken_as_players_take_it(tmp_path, height, matrix):
    picture = np.full((height, 64, 3), COLOUR, np.uint8)
    path = write_video(
        tmp_path / "v.mp4", [picture], "libx264", "yuv444p", options={"qp": "0"}, matrix=matrix
    )
    (frame,) = read_video(path)
    # The other matrix is off by 14.
    assert np.abs(frame.counts.astype(int) - COLOUR).max() <= 2


def test_damaged_frames_are_left_out_and_their_numbers_with_them(tmp_path):
    pictures = [RNG.integers(0, 256, (64, 64, 3), np.uint8) for _ in range(40)]
    path = write_video(
        tmp_path / "v.mp4", pictures, "libx264", "yuv420p", options={"g": "1", "bf": "0"}
    )
    data = bytearray(path.read_bytes())
    for position in range(len(data) // 4, len(data) // 2, 997):
        data[position] ^= 0xFF
    path.write_bytes(data)
    indices = [frame.index for frame in read_video(path)]
    assert 0 < len(indices) < 40
    assert indices == sorted(set(indices))
    assert indices[-1] == 39


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"text, not a video\n" * 100,
        b"#EXTM3U\n#EXTINF:1,\nv.mkv\n",
        b"ffconcat version 1.0\nfile 'v.mkv'\n",
    ],
)
def test_what_is_no_video_is_refused_by_name(tmp_path, data, monkeypatch):
    monkeypatch.chdir(tmp_path)  # playlists name files relative to it
    write_video(tmp_path / "v.mkv", [np.zeros((32, 32, 3), np.uint8)], "ffv1", "bgr0")
    path = tmp_path / "no.mp4"
    path.write_bytes(data)
    with pytest.raises(UnreadableFrame, match=r"no\.mp4"):
        list(read_video(path))


def test_sound_alone_is_no_video(tmp_path):
    path = tmp_path / "sound.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), layout="mono")
        frame.rate = 8000
        container.mux(stream.encode(frame))
    with pytest.raises(UnreadableFrame, match="no picture stream"):
        list(read_video(path))


def test_a_video_for_hdr_displays_is_refused(tmp_path):
    path = tmp_path / "hdr.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        stream.codec_context.color_trc = 16  # PQ
        container.mux(stream.encode(av.VideoFrame(64, 64, "yuv420p")))
        container.mux(stream.encode(None))
    with pytest.raises(InputError, match="PQ"):
        list(read_video(path))


def test_the_length_is_limited(tmp_path, monkeypatch):
    pictures = [np.zeros((32, 32, 3), np.uint8)] * 4
    path = write_video(tmp_path / "v.mkv", pictures, "ffv1", "bgr0")
    monkeypatch.setattr(capture.video, "MAX_FRAMES", 3)
    with pytest.raises(InputError, match="more than 3 frames"):
        list(read_video(path))


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "size", "interval_s"),
    [
        ("seq-stanford-skippd/sunny_day_demo_1.gif", (64, 64), 0.1),
        ("seq-theta360-dash/richoh1_0_3.mp4", (322, 640), 1 / 30),
    ],
)
def test_real_videos_begin_as_they_should(name, size, interval_s):
    if not (DATA / name).is_file():
        pytest.skip(f"{name} is not at hand")
    frames = read_video(DATA / name)
    first = [next(frames) for _ in range(5)]
    frames.close()
    assert all(frame.counts.shape[:2] == size for frame in first)
    assert [frame.timestamp_s for frame in first] == pytest.approx(np.arange(5) * interval_s)
