"""The door of every reader: what a file is, is looked at before its bytes."""

import os
from pathlib import Path

import pytest

from capture.errors import InputError, UnreadableFrame
from capture.exr import read_exr
from capture.files import MAX_BYTES, read_bytes
from capture.pictures import read_picture
from capture.radiance_files import read_hdr
from capture.raw import read_raw


def test_a_file_may_have_as_many_bytes_as_are_read_and_no_more(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    with pytest.raises(UnreadableFrame, match=r"a\.bin: 5 bytes, more than the 4"):
        read_bytes(path, 4)


@pytest.mark.parametrize(
    ("name", "read"),
    [("a.png", read_picture), ("a.exr", read_exr), ("a.hdr", read_hdr), ("a.dng", read_raw)],
)
def test_a_giant_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, read: object
) -> None:
    path = tmp_path / name
    path.touch()
    os.truncate(path, MAX_BYTES + 1)  # takes no place on the disk
    monkeypatch.setattr(Path, "read_bytes", None)
    monkeypatch.setattr(Path, "open", None)
    with pytest.raises(InputError, match=rf"{name}: {MAX_BYTES + 1} bytes, more than"):
        read(path)


@pytest.mark.parametrize("read", [read_picture, read_exr, read_hdr, read_raw])
def test_folders_and_pipes_are_no_files(tmp_path: Path, read: object) -> None:
    folder, pipe = tmp_path / "a.exr", tmp_path / "b.exr"
    folder.mkdir()
    os.mkfifo(pipe)  # to read from it would wait for ever
    for path in (folder, pipe):
        with pytest.raises(InputError, match="not a file"):
            read(path)
