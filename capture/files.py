"""The door of every reader: a file that exists, and a picture that fits into memory."""

from pathlib import Path

from capture.errors import InputError, UnreadableFrame

MAX_PIXELS = 2**27
"""Largest picture that is read. More is a damaged or hostile header: no camera makes it."""

MAX_BYTES = 2**31
"""Largest file that is read: MAX_PIXELS of four float32 channels."""


def read_bytes(path: Path, most_bytes: int = MAX_BYTES) -> bytes:
    """Return a file's bytes; more than `most_bytes` are refused before they are read.

    Raises
    ------
    InputError
        If `path` is not an existing, readable file.
    UnreadableFrame
        If it is empty or too large.
    """
    check_file(path, most_bytes)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def check_file(path: Path, most_bytes: int = MAX_BYTES) -> None:
    """Raise as `read_bytes` does if `path` cannot be read."""
    try:
        if not path.exists():
            raise InputError(f"{path}: no such file")
        if not path.is_file():
            raise InputError(f"{path}: not a file")
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if size == 0:
        raise UnreadableFrame(f"{path}: the file is empty")
    if size > most_bytes:
        raise UnreadableFrame(f"{path}: {size} bytes, more than the {most_bytes} that are read")


def check_size(path: Path, width_px: int, height_px: int) -> None:
    """Raise UnreadableFrame if a header announces more than MAX_PIXELS."""
    if width_px * height_px > MAX_PIXELS:
        raise UnreadableFrame(
            f"{path}: the header says {width_px}×{height_px} px, more than the "
            f"{MAX_PIXELS} that are read; the file is damaged or not a camera's picture"
        )
