"""Outputs appear whole or not at all, and what cannot be written is told in one line."""

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from capture.errors import InputError
from capture.exr import write_exr
from capture.output import check_place, refuse_existing, replacing, write_text
from capture.pictures import write_png


def test_a_failed_write_keeps_the_older_file_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("older")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "half\ud800")
    assert path.read_text() == "older"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "usual").write_text("")
    write_text(tmp_path / "new", "text")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("force", [False, True])
def test_a_folder_is_never_replaced(tmp_path: Path, force: bool) -> None:
    (tmp_path / "a.exr").mkdir()
    with pytest.raises(InputError, match=r"a\.exr is a folder"):
        refuse_existing(tmp_path / "a.exr", force=force)
    with pytest.raises(InputError, match=r"a\.exr is a folder"):
        write_text(tmp_path / "a.exr", "text", force=force)


@pytest.mark.parametrize("name", ["/proc/a.txt", "a" * 300])
def test_a_place_that_takes_no_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / name, "text")


@contextmanager
def full_disk() -> Iterator[None]:
    """As good as a full disk: no file of this process may grow beyond 100 bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


PICTURE = np.random.default_rng(1).integers(0, 65536, (20, 30, 3), dtype=np.uint16)


@pytest.mark.parametrize(
    "write",
    [
        lambda path: write_text(path, "text" * 100),
        lambda path: write_png(path, PICTURE),
        lambda path: write_exr(path, {"Y": PICTURE[..., 0].astype(np.float32)}, {}),
    ],
    ids=["text", "PNG", "EXR"],
)
def test_a_full_disk_is_told_and_leaves_nothing(tmp_path: Path, write) -> None:
    told = r"a\.file: cannot be written \(.*[Ff]ile too large"
    with pytest.raises(InputError, match=told), full_disk():
        write(tmp_path / "a.file")
    assert not os.listdir(tmp_path)


def test_trouble_with_another_file_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="missing"), replacing(tmp_path / "a.txt"):
        (tmp_path / "missing").read_bytes()


def test_a_folder_that_may_not_be_written_to_is_told_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The superuser, who runs some tests, may write everywhere: the system's answer is replaced."""
    monkeypatch.setattr(os, "access", lambda _path, mode: not mode & os.W_OK)
    with pytest.raises(InputError, match=r"a\.exr: cannot be written \(no permission"):
        check_place(tmp_path / "a.exr", force=False)
