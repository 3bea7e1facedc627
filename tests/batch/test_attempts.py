"""Frames that end their process are given up after three; others keep all their attempts."""

import os
from pathlib import Path

import pytest

from capture.errors import UnreadableFrame
from render.batch.attempts import attempt, forget_attempts


def die_at(folder: Path, name: str) -> None:
    """Let another process die while it works on a frame."""
    child = os.fork()
    if not child:
        with attempt(folder, name):
            os._exit(9)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9


def test_a_frame_is_given_up_when_three_processes_died_of_it(tmp_path):
    forget_attempts(tmp_path)
    for _ in range(3):
        die_at(tmp_path, "frame")
    with pytest.raises(UnreadableFrame, match="3 processes that worked on it died"):
        attempt(tmp_path, "frame").__enter__()
    with attempt(tmp_path, "another"):
        pass
    forget_attempts(tmp_path)
    with attempt(tmp_path, "frame"):
        pass


def test_what_ends_well_or_is_told_counts_for_nothing(tmp_path):
    forget_attempts(tmp_path)
    for _ in range(4):
        with attempt(tmp_path, "frame"):
            pass
        with pytest.raises(ValueError, match="told"), attempt(tmp_path, "frame"):
            raise ValueError("told")
    die_at(tmp_path, "frame")
    die_at(tmp_path, "frame")
    with attempt(tmp_path, "frame"):
        pass
    assert not list(tmp_path.iterdir())
