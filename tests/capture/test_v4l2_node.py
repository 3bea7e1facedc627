"""Cameras are found by what users call them, and errors of the system say what can be done."""

import contextlib
import errno
import fcntl
import os
from pathlib import Path
from typing import Any

import pytest

from capture.errors import CameraLost, InputError
from capture.v4l2 import finding, kernel
from capture.v4l2.finding import find_camera, list_cameras
from capture.v4l2.node import VideoNode


def test_a_camera_that_is_not_there_is_named_with_those_that_are(tmp_path: Any) -> None:
    with pytest.raises(InputError, match=r"no camera 7; there is no .*/video\*: no camera is plug"):
        find_camera("7", tmp_path)
    with pytest.raises(InputError, match="which camera"):
        find_camera("", tmp_path)
    (tmp_path / "video0").touch()
    with pytest.raises(InputError, match=r"no camera Webcam; none of .*/video\* is a camera"):
        find_camera("Webcam", tmp_path)
    assert list_cameras(tmp_path) == []


def test_a_path_an_id_and_a_number_find_the_node(tmp_path: Any) -> None:
    """Character devices of any kind stand in for the nodes."""
    by_id = tmp_path / "v4l" / "by-id"
    by_id.mkdir(parents=True)
    (tmp_path / "video3").symlink_to("/dev/null")
    (by_id / "usb-Maker_Webcam-video-index0").symlink_to("/dev/null")
    assert find_camera("/dev/null", tmp_path).samefile("/dev/null")
    assert find_camera("3", tmp_path) == tmp_path / "video3"
    assert find_camera("video3", tmp_path) == tmp_path / "video3"
    assert find_camera("usb-Maker_Webcam-video-index0", tmp_path).parent == by_id


CARDS = {
    "video0": "HD 720p Webcam: HD 720p Webcam ",  # 31 characters, as the kernel cuts it
    "video2": "USB Fisheye",
    "video3": "USB Fisheye Pro",
}


@pytest.fixture
def cards(monkeypatch: Any, tmp_path: Any) -> Any:
    """Three cameras that are there only by their names."""

    class Node(contextlib.nullcontext[Any]):
        def __init__(self, path: Path) -> None:
            super().__init__(self)
            self.card = CARDS[path.name]

    monkeypatch.setattr(finding, "VideoNode", Node)
    for name in CARDS:
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize(
    ("called", "node"),
    [
        ("USB Fisheye", "video2"),  # the whole name of one, though it begins another's
        ("Fisheye Pro", "video3"),
        ("usb fisheye p", "video3"),
        ("HD 720p Webcam: HD 720p Webcam (046d:0825)", "video0"),
    ],
)
def test_a_part_of_its_name_finds_a_camera(cards: Any, called: str, node: str) -> None:
    assert find_camera(called, cards) == cards / node


def test_a_part_of_two_names_names_both_and_a_number_is_no_part(cards: Any) -> None:
    with pytest.raises(InputError, match=r"several .*'fisheye'.*video2 \(USB.*video3 \(USB"):
        find_camera("fisheye", cards)
    with pytest.raises(InputError, match=r"no camera 7; cameras found: .*video0.*video2.*video3"):
        find_camera("7", cards)


def test_what_is_no_camera_is_refused(tmp_path: Any) -> None:
    with pytest.raises(InputError, match="/dev/null: not a video device"):
        VideoNode(find_camera("/dev/null"))
    with pytest.raises(InputError, match="cannot be opened"):
        VideoNode(tmp_path)


@pytest.mark.parametrize(
    ("number", "error", "message"),
    [
        ("EACCES", InputError, "belong to the group video"),
        ("ENODEV", CameraLost, "is gone"),
        ("EBUSY", InputError, "cannot be opened"),
    ],
)
def test_opening_tells_what_can_be_done(
    monkeypatch: Any, number: str, error: type[Exception], message: str
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(getattr(errno, number), "refused")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(error, match=message):
        VideoNode(Path("/dev/video0"))


@pytest.mark.parametrize(
    ("number", "error", "message"),
    [
        ("ENODEV", CameraLost, "is gone"),
        ("ESHUTDOWN", CameraLost, "is gone"),
        ("EBUSY", InputError, "cannot start; another program is using the camera"),
        ("ENOSPC", InputError, "cannot start; the USB bus has no room"),
        ("EINVAL", OSError, "/dev/null: cannot start: refused"),
    ],
)
def test_requests_tell_what_can_be_done(
    monkeypatch: Any, number: str, error: type[Exception], message: str
) -> None:
    def answer(fd: int, request: int, argument: Any) -> None:
        if request != kernel.QUERY_CAPABILITY:
            raise OSError(getattr(errno, number), "refused")
        argument.card, argument.capabilities = b"Cam", kernel.HAS_DEVICE_CAPABILITIES | 1
        argument.device_caps = kernel.CAN_CAPTURE | kernel.CAN_STREAM

    monkeypatch.setattr(fcntl, "ioctl", answer)
    with VideoNode(Path("/dev/null")) as opened:
        assert opened.card == "Cam"
        with pytest.raises(error, match=message):
            opened.call(kernel.STREAM_ON, kernel.c_int32(1), "start")
    assert opened.fd == -1
    opened.close()


def test_a_name_that_would_steer_a_terminal_is_made_harmless(monkeypatch: Any) -> None:
    """The name is the camera's own; a manifest that held it could not be read again."""

    def answer(fd: int, request: int, argument: Any) -> None:
        argument.card, argument.driver = b"Cam\x1b[2J\xff", b"uvcvideo"
        argument.capabilities = kernel.CAN_CAPTURE | kernel.CAN_STREAM

    monkeypatch.setattr(fcntl, "ioctl", answer)
    with VideoNode(Path("/dev/null")) as opened:
        assert (opened.card, opened.driver) == ("Cam\ufffd[2J\ufffd", "uvcvideo")


def test_a_node_of_another_kind_is_told_apart(monkeypatch: Any) -> None:
    """A USB camera has a second node, for metadata; the device as a whole captures."""
    abilities = kernel.HAS_DEVICE_CAPABILITIES | kernel.CAN_CAPTURE | kernel.CAN_STREAM

    def answer(fd: int, request: int, argument: Any) -> None:
        argument.capabilities, argument.device_caps = abilities, own

    monkeypatch.setattr(fcntl, "ioctl", answer)
    for own, message in (  # noqa: B007, `answer` reads it
        (0x0080_0000, "does not capture pictures; a camera's other node may"),
        (kernel.CAN_CAPTURE_PLANES, "planes in separate buffers"),
        (kernel.CAN_CAPTURE, "cannot stream"),
    ):
        with pytest.raises(InputError, match=message):
            VideoNode(Path("/dev/null"))
