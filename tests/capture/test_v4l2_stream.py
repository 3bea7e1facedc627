"""Buffers go to the driver and back; what the driver says of a frame is told."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from capture.errors import CameraLost, CameraStalled, InputError
from capture.v4l2 import kernel
from capture.v4l2.stream import VideoStream

LENGTH = 4096  # a page: buffers lie one behind the other in a memory file


class Driver:
    """Stands in for a VideoNode: buffers in a memory file, which polls as ready at all times."""

    def __init__(self) -> None:
        self.path, self.card = Path("/dev/video7"), "Test camera"
        self.fd = os.memfd_create("buffers")
        self.granted = 3
        self.queued: list[int] = []
        self.filled: list[kernel.Buffer] = []
        self.requests: list[int] = []
        self.fails: dict[int, Exception] = {}

    def call(self, request: int, argument: Any, purpose: str) -> None:
        self.requests.append(request)
        if request in self.fails:
            raise self.fails[request]
        if request == kernel.REQUEST_BUFFERS and argument.count:
            argument.count = self.granted
            os.ftruncate(self.fd, self.granted * LENGTH)
        elif request == kernel.QUERY_BUFFER:
            argument.offset, argument.length = argument.index * LENGTH, LENGTH
        elif request == kernel.QUEUE_BUFFER:
            self.queued.append(argument.index)
        elif request == kernel.DEQUEUE_BUFFER:
            if not self.filled:
                raise OSError(errno.EAGAIN, "Resource temporarily unavailable")
            answer = self.filled.pop(0)
            for name, _ in kernel.Buffer._fields_:
                setattr(argument, name, getattr(answer, name))

    def fill(self, data: bytes, flags: int = kernel.TIMESTAMP_MONOTONIC, sequence: int = 0) -> None:
        """Fill the buffer that was queued first, as of 12.25 s."""
        index = self.queued.pop(0)
        os.pwrite(self.fd, data, index * LENGTH)
        self.filled.append(
            kernel.Buffer(
                index=index, bytesused=len(data), flags=flags, sequence=sequence,
                seconds=12, microseconds=250_000,
            )
        )  # fmt: skip


@pytest.fixture
def driver() -> Iterator[Any]:
    driver = Driver()
    yield driver
    if driver.fd >= 0:
        os.close(driver.fd)


def test_frames_come_in_order_with_what_the_driver_says_of_them(driver: Any) -> None:
    stream = VideoStream(driver)
    assert driver.queued == [0, 1, 2]
    driver.fill(b"first", sequence=7)
    driver.fill(b"second", flags=kernel.TIMESTAMP_MONOTONIC | kernel.BUFFER_ERROR, sequence=9)
    first, second = stream.next_frame(1.0), stream.next_frame(1.0)
    assert first is not None
    assert second is not None
    assert (first.data, first.sequence, first.timestamp_s) == (b"first", 7, 12.25)
    assert (first.is_damaged, second.is_damaged) == (False, True)
    assert second.data == b"second"
    assert stream.next_frame(0.0) is None
    assert driver.queued == [2, 0, 1]  # given back at once, so that none is missing
    stream.close()


def test_data_outlive_their_buffer(driver: Any) -> None:
    stream = VideoStream(driver)
    driver.granted = 1
    driver.fill(b"first")
    frame = stream.next_frame(1.0)
    driver.queued = [0]
    driver.fill(b"other")
    stream.close()
    assert frame is not None
    assert frame.data == b"first"


@pytest.mark.parametrize("flags", [0, 0x4000])
def test_stamps_of_an_unknown_or_copied_clock_are_refused(driver: Any, flags: int) -> None:
    stream = VideoStream(driver)
    driver.fill(b"first", flags=flags)
    with pytest.raises(InputError, match="not stamped by the monotonic clock"):
        stream.next_frame(1.0)


def test_a_stream_that_the_driver_stops_is_stalled_and_an_unplugged_camera_lost(
    driver: Any,
) -> None:
    stream = VideoStream(driver)
    driver.fails[kernel.DEQUEUE_BUFFER] = OSError(errno.EIO, "cannot take a frame: EIO")
    with pytest.raises(CameraStalled, match="cannot take a frame: EIO; the stream has stopped"):
        stream.next_frame(1.0)
    driver.fails[kernel.DEQUEUE_BUFFER] = CameraLost("gone")
    with pytest.raises(CameraLost):
        stream.next_frame(1.0)


@pytest.mark.parametrize("request_", [kernel.REQUEST_BUFFERS, kernel.STREAM_ON])
def test_a_stream_that_does_not_start_is_told_and_gives_its_buffers_back(
    driver: Any, request_: int
) -> None:
    driver.fails[request_] = OSError(errno.EINVAL, "cannot start: EINVAL")
    with pytest.raises(CameraStalled, match="cannot start: EINVAL"):
        VideoStream(driver)
    assert driver.requests[-2:] == [kernel.STREAM_OFF, kernel.REQUEST_BUFFERS]
    driver.fails = {request_: InputError("in use")}
    with pytest.raises(InputError, match="in use"):
        VideoStream(driver)


def test_closing_works_when_the_camera_is_gone_and_twice(driver: Any) -> None:
    stream = VideoStream(driver)
    gone = CameraLost("gone")
    driver.fails = {kernel.STREAM_OFF: gone, kernel.REQUEST_BUFFERS: gone}
    stream.close()
    os.close(driver.fd)
    driver.fd = -1
    before = len(driver.requests)
    stream.close()
    assert len(driver.requests) == before
