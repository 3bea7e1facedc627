"""Frames as the kernel delivers them, by buffers that are mapped into memory.

Input  : VideoNode whose format is set.    Output : Delivery after Delivery.
Cost   : one copy of each frame, so that its buffer goes back to the driver at once.
"""

import errno
import mmap
import select
import time
from contextlib import suppress
from ctypes import Structure, c_int32
from dataclasses import dataclass
from typing import Protocol

from capture.errors import CameraLost, CameraStalled, InputError
from capture.v4l2 import kernel
from capture.v4l2.node import VideoNode

_BUFFERS = 6
"""Room for 0.2 s at 30 frames a second while the caller is busy."""


@dataclass(frozen=True)
class Delivery:
    """One frame as it came.

    Attributes
    ----------
    data : bytes
        In the stream's pixel format.
    sequence : int
        The driver's count of frames; a gap is a frame that was lost.
    timestamp_s : float
        CLOCK_MONOTONIC. USB cameras: when the frame's first packet arrived.
    is_damaged : bool
        The driver says that data are missing or wrong.
    """

    data: bytes
    sequence: int
    timestamp_s: float
    is_damaged: bool


class FrameStream(Protocol):
    """What the cycling of exposures needs to know of a stream of frames."""

    def next_frame(self, timeout_s: float) -> Delivery | None:
        """Return the oldest frame waiting, or the next within the time, or None."""

    def now_s(self) -> float:
        """Return the time on the clock of the timestamps."""


class VideoStream:
    """A running stream; owns the driver's buffers until it is closed.

    Raises
    ------
    CameraStalled
        If the driver does not start the stream.
    CameraLost, InputError
        As `VideoNode.call`.
    """

    def __init__(self, node: VideoNode) -> None:
        self._node = node
        self._maps: list[mmap.mmap] = []
        self._poll = select.poll()
        self._poll.register(node.fd, select.POLLIN)
        try:
            request = kernel.BufferRequest(
                count=_BUFFERS, type=kernel.VIDEO_CAPTURE, memory=kernel.MEMORY_MMAP
            )
            node.call(kernel.REQUEST_BUFFERS, request, "get buffers")
            for index in range(request.count):
                buffer = _buffer(index)
                node.call(kernel.QUERY_BUFFER, buffer, "get buffers")
                self._maps.append(mmap.mmap(node.fd, buffer.length, offset=buffer.offset))
                node.call(kernel.QUEUE_BUFFER, buffer, "queue buffers")
            node.call(kernel.STREAM_ON, c_int32(kernel.VIDEO_CAPTURE), "start streaming")
        except OSError as error:
            self.close()
            raise CameraStalled(str(error.strerror or error)) from None
        except BaseException:
            self.close()
            raise

    def next_frame(self, timeout_s: float) -> Delivery | None:
        """Return the oldest frame waiting, or the next one; None if none comes within the time.

        Raises
        ------
        CameraLost
            If the camera is unplugged.
        CameraStalled
            If the driver has stopped the stream.
        InputError
            If frames are not stamped by CLOCK_MONOTONIC, by which settings are timed.
        """
        ready = self._poll.poll(max(timeout_s, 0.0) * 1e3)
        if not ready:
            return None
        buffer = _buffer(0)
        try:
            self._node.call(kernel.DEQUEUE_BUFFER, buffer, "take a frame")
        except OSError as error:
            if error.errno == errno.EAGAIN and not ready[0][1] & select.POLLERR:
                return None
            raise CameraStalled(f"{error.strerror}; the stream has stopped") from None
        data = self._maps[buffer.index][: buffer.bytesused]
        try:
            self._node.call(kernel.QUEUE_BUFFER, _buffer(buffer.index), "queue buffers")
        except OSError as error:
            raise CameraStalled(f"{error.strerror}; the stream has stopped") from None
        if buffer.flags & kernel.TIMESTAMP_MASK != kernel.TIMESTAMP_MONOTONIC:
            raise InputError(
                f"{self._node.path} ({self._node.card}): its frames are not stamped by the "
                "monotonic clock, so it cannot be told which exposure a frame has"
            )
        return Delivery(
            data=data,
            sequence=buffer.sequence,
            timestamp_s=buffer.seconds + 1e-6 * buffer.microseconds,
            is_damaged=bool(buffer.flags & kernel.BUFFER_ERROR),
        )

    def now_s(self) -> float:
        """Return CLOCK_MONOTONIC, by which frames are stamped."""
        return time.monotonic()

    def close(self) -> None:
        """Stop the stream and give its buffers back; harmless if the camera is gone or closed."""
        if self._node.fd < 0:
            return
        self._request(kernel.STREAM_OFF, c_int32(kernel.VIDEO_CAPTURE))
        for mapped in self._maps:
            mapped.close()
        self._maps = []
        nothing = kernel.BufferRequest(type=kernel.VIDEO_CAPTURE, memory=kernel.MEMORY_MMAP)
        self._request(kernel.REQUEST_BUFFERS, nothing)

    def _request(self, request: int, argument: Structure | c_int32) -> None:
        """Make a request of the end, whose failure changes nothing any more."""
        with suppress(OSError, CameraLost, InputError):
            self._node.call(request, argument, "stop streaming")


def _buffer(index: int) -> kernel.Buffer:
    return kernel.Buffer(index=index, type=kernel.VIDEO_CAPTURE, memory=kernel.MEMORY_MMAP)
