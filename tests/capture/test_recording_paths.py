"""A recording names no file outside of its folder."""

import os
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from capture.recording import contained_file


@pytest.fixture(scope="module")
def folder_with_traps(tmp_path_factory):
    place = tmp_path_factory.mktemp("traps")
    folder = place / "recording"
    (folder / "frames").mkdir(parents=True)
    (folder / "frames" / "a").write_text("inside")
    (place / "secret").write_text("outside")
    (folder / "frames" / "out").symlink_to(place / "secret")
    (folder / "up").symlink_to(place)
    (folder / "in").symlink_to(folder / "frames")
    (folder / "loop").symlink_to(folder / "loop")
    os.mkfifo(folder / "pipe")
    return folder


PARTS = st.sampled_from(
    ["..", ".", "", "frames", "a", "out", "up", "in", "loop", "pipe", "secret", "recording", "\0"]
)


@given(name=st.one_of(st.lists(PARTS, max_size=5).map("/".join), st.text(max_size=20)))
@example(name="in/a")
@example(name="up/secret")
@example(name="frames/out")
@example(name="/dev/zero")
@example(name="\ud800")
@example(name="a" * 5000)
@settings(max_examples=300, deadline=None)
def test_no_path_leaves_the_folder(folder_with_traps, name):
    try:
        path = contained_file(folder_with_traps, name)
    except InputError as refusal:
        told = str(refusal)
    else:
        told = ""
        assert Path(os.path.realpath(path)).read_text() == "inside"
    assert "\n" not in told


def test_a_link_that_stays_inside_is_followed(folder_with_traps):
    assert contained_file(folder_with_traps, "in/a").read_text() == "inside"
