"""Whenever a writer is killed, what is on disk is a recording."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from capture.errors import InputError
from capture.frame import Bracket
from capture.recording import open_recording

ROOT = Path(__file__).resolve().parents[2]
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
