"""Results appear whole or not at all: written beside their place, then renamed into it."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from capture.errors import InputError

PARTIAL_PREFIX = ".partial-"
"""How the names of unfinished files begin; one that is killed leaves its own behind."""

_UMASK = os.umask(0)  # can only be read by setting it; done once, before any thread starts
os.umask(_UMASK)


def refuse_existing(path: Path, *, force: bool) -> None:
    """Raise InputError if `path` is a folder, or exists and `force` is not set."""
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder; name a file")
        if path.exists() and not force:
            raise InputError(f"{path} exists; give --force to replace it")
    except OSError as error:  # a name that is too long, a folder that may not be entered
        raise _unwritable(path, error) from None


def check_place(path: Path, *, force: bool) -> None:
    """Raise InputError as `refuse_existing`, or if nothing can be written beside `path`."""
    refuse_existing(path, force=force)
    if not path.parent.is_dir():
        raise InputError(f"{path.parent} is not a folder; {path.name} cannot be written there")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written (no permission, or a read-only disk)")


@contextmanager
def replacing(path: Path, *, force: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`, which takes its name when the block succeeds.

    The temporary name keeps the suffix, for libraries that choose a format by it. On an exception
    nothing is left behind and an older file stays as it was. The content is on the disk before the
    name is, so a power cut leaves the one file or the other, never a part.

    Raises
    ------
    InputError
        If `path` exists and `force` is False, its folder does not exist, or the file cannot be
        written (no permission, no space).
    """
    check_place(path, force=force)
    try:
        handle, name = tempfile.mkstemp(prefix=PARTIAL_PREFIX, suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise _unwritable(path, error) from None
    os.close(handle)
    partial = Path(name)
    try:
        yield partial
        partial.chmod(0o666 & ~_UMASK)
        _sync(partial)
        partial.replace(path)
    except OSError as error:
        if error.filename not in (None, name):  # the block's trouble with another file
            raise
        raise _unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def write_text(path: Path, text: str, *, force: bool = True) -> None:
    """Write UTF-8 text to `path`, whole or not at all."""
    with replacing(path, force=force) as partial:
        partial.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any, *, force: bool = True) -> None:
    """Write what msgspec encodes to `path` as indented JSON, whole or not at all."""
    text = msgspec.json.format(msgspec.json.encode(content), indent=1).decode()
    write_text(path, text + "\n", force=force)


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written ({error.strerror or error})")


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
