"""Video files: what a player finds in them."""

import av
import numpy as np
import pytest

from capture.errors import InputError
from render.output.video import VideoWriter


def bars(index, width=101, height=75):
    picture = np.full((height, width, 3), (200, 100, 50), np.uint8)
    picture[:, 4 * index : 4 * index + 8] = (20, 30, 160)
    return picture


def write(path, count=12, rate_hz=25.0):
    with VideoWriter(path, (101, 75), rate_hz) as writer:
        for index in range(count):
            writer.write(bars(index))


def test_the_pictures_come_back_in_order_and_colour(tmp_path):
    write(tmp_path / "v.mp4")
    with av.open(str(tmp_path / "v.mp4")) as container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert stream.average_rate == 25
        assert (stream.width, stream.height) == (102, 76)  # pairs
        assert stream.codec_context.pix_fmt == "yuv420p"
    assert len(frames) == 12
    for index, frame in enumerate(frames):
        # Middle of each colour, away from the halved resolution's edges.
        assert np.abs(frame[40, 4 * index + 4].astype(int) - (20, 30, 160)).max() < 8
        assert np.abs(frame[40, 90].astype(int) - (200, 100, 50)).max() < 8


def test_the_index_stands_before_the_pictures(tmp_path):
    write(tmp_path / "v.mp4")
    data = (tmp_path / "v.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")


def test_same_bytes_twice(tmp_path):
    write(tmp_path / "a.mp4")
    write(tmp_path / "b.mp4")
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_failure_leaves_the_older_video(tmp_path):
    path = tmp_path / "v.mp4"
    path.write_bytes(b"older")

    def fail_midway():
        with VideoWriter(path, (101, 75), 25.0) as writer:
            writer.write(bars(0))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_midway()
    assert path.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [path]


def test_an_encoder_that_is_missing_leaves_nothing(tmp_path, monkeypatch):
    def missing(writer):
        raise av.codec.codec.UnknownCodecError("libx264")

    monkeypatch.setattr(VideoWriter, "_add_stream", missing)
    with pytest.raises(av.codec.codec.UnknownCodecError):
        write(tmp_path / "v.mp4")
    assert not list(tmp_path.iterdir())


def test_a_video_without_pictures_is_refused(tmp_path):
    with pytest.raises(InputError, match="at least one picture"):
        write(tmp_path / "v.mp4", count=0)
    assert not list(tmp_path.iterdir())


def test_wrong_size_and_rate_are_refused(tmp_path):
    with (
        pytest.raises(ValueError, match=r"\(75, 101, 3\)"),
        VideoWriter(tmp_path / "v.mp4", (101, 75), 25.0) as writer,
    ):
        writer.write(np.zeros((10, 10, 3), np.uint8))
    with pytest.raises(InputError, match="frame rate"):
        VideoWriter(tmp_path / "v.mp4", (101, 75), 0.0)
