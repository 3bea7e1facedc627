"""Frames that end the process that works on them: noticed by the next one, and given up in time.

Before a frame is begun a small file counts the attempt, and it is removed when the frame is done,
well or not. What is left was left by a process that died; whoever comes next, on whatever machine,
sees how often that was. So a frame cannot take one worker after the other, and whoever happened to
work beside it is not blamed.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from capture.errors import UnreadableFrame

MOST_ATTEMPTS = 3


@contextmanager
def attempt(folder: Path, name: str) -> Iterator[None]:
    """Count an attempt at frame `name` while the block runs.

    Raises
    ------
    UnreadableFrame
        If three processes died in theirs.
    """
    path = folder / name
    died = 0
    with suppress(FileNotFoundError):
        died = len(path.read_bytes())
    if died >= MOST_ATTEMPTS:
        raise UnreadableFrame(f"given up: {died} processes that worked on it died")
    path.write_bytes(b"x" * (died + 1))
    try:
        yield
    finally:
        path.unlink(missing_ok=True)


def forget_attempts(folder: Path) -> None:
    """Give every frame all its attempts again, and make the folder that counts them."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        path.unlink(missing_ok=True)
