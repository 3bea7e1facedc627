"""What is done with vivid, the kernel's virtual camera, inside the guest: it fails when asked to.

Output : report.json in the folder given, judged outside (vivid_faults.py).
"""

import ctypes
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from capture.errors import FishlightError
from capture.v4l2 import kernel
from capture.v4l2.camera import CameraRequest, open_camera
from capture.v4l2.formats import choose_format
from capture.v4l2.node import VideoNode
from capture.v4l2.stream import VideoStream

NODE = Path("/dev/video0")
FRAMES = 20

# Numbers of the kernel's vivid-ctrls.c.
_DROPPED_PERCENT = 0xF0F040
_DISCONNECT, _DAMAGED, _NO_BUFFERS, _NO_QUEUE, _NO_START, _FATAL = range(0xF0F041, 0xF0F047)


def brackets_refused() -> Any:
    """Open it as a camera for brackets: it has no exposure time."""
    return error_of(lambda: open_camera(CameraRequest(str(NODE), None, "YUYV", None)))


def frames_with(number: int, value: int) -> Any:
    """Set a control of vivid's, and read frames: how they are numbered and which are damaged."""
    with opened() as node:
        stream = VideoStream(node)
        stream.next_frame(2.0)
        press(node, number, value)
        frames = [stream.next_frame(2.0) for _ in range(FRAMES)]
        stream.close()
    assert None not in frames
    return {
        "sequences": [frame.sequence for frame in frames if frame],
        "damaged": sum(frame.is_damaged for frame in frames if frame),
        "bytes": [len(frame.data) for frame in frames if frame],
    }


def start_with(number: int) -> Any:
    """Inject an error, start a stream, and start it again."""
    with opened() as node:
        press(node, number, 1)
        first = error_of(lambda: VideoStream(node))
        stream = VideoStream(node)
        delivered = stream.next_frame(2.0) is not None
        stream.close()
    return {"error": first, "again": delivered}


def stream_with(number: int) -> Any:
    """Inject an error into a running stream, and read until it shows."""

    def read() -> None:
        for _ in range(FRAMES):
            stream.next_frame(2.0)

    with opened() as node:
        stream = VideoStream(node)
        stream.next_frame(2.0)
        press(node, number, 1)
        found = error_of(read)
        stream.close()
    return found


def opened() -> VideoNode:
    """Return the node, its format set."""
    node = VideoNode(NODE)
    choose_format(node, "YUYV", None, {"YUYV"})
    return node


def press(node: VideoNode, number: int, value: int) -> None:
    """Set a control; a button has no value to be read back."""
    wanted = kernel.ControlValue(id=number, value64=value)
    values = kernel.ControlValues(count=1, controls=ctypes.pointer(wanted))
    node.call(kernel.SET_CONTROLS, values, f"press {number:#x}")


def error_of(action: Callable[[], object]) -> str | None:
    """Return what an action raised."""
    try:
        action()
    except FishlightError as error:
        return f"{type(error).__name__}: {error}"
    return None


if __name__ == "__main__":
    report = {
        "brackets": brackets_refused(),
        "dropped": frames_with(_DROPPED_PERCENT, 50),
        "healthy": frames_with(_DROPPED_PERCENT, 0),
        "damaged": frames_with(_DAMAGED, 1),
        "no buffers": start_with(_NO_BUFFERS),
        "no start": start_with(_NO_START),
        "no queue": stream_with(_NO_QUEUE),
        "fatal": stream_with(_FATAL),
        "disconnected": stream_with(_DISCONNECT),
        "reconnected": error_of(lambda: VideoNode(NODE).close()),
    }
    (Path(sys.argv[1]) / "report.json").write_text(json.dumps(report))
