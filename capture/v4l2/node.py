"""One open video device: its descriptor, what it is, and what its errors mean.

Input  : the path of a device node.    Output : VideoNode, through which every request goes.
"""

import ctypes
import errno
import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from capture.errors import CameraLost, InputError
from capture.printable import printable
from capture.v4l2 import kernel

_GONE = frozenset((errno.ENODEV, errno.ENXIO, errno.ESHUTDOWN))


class VideoNode:
    """An open device node, closed when the `with` block ends.

    Attributes
    ----------
    path : Path
    card, driver : str
        What the device calls itself, and what runs it.
    fd : int

    Raises
    ------
    InputError
        If it cannot be opened, or is no device that captures pictures by streaming.
    CameraLost
        If it has just been unplugged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.fd = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        except PermissionError:
            raise InputError(
                f"{path}: permission denied; cameras belong to the group video, which you join "
                "with `sudo usermod -aG video $USER` and a new login"
            ) from None
        except OSError as error:
            if error.errno in _GONE:
                raise CameraLost(f"{path}: the camera is gone ({error.strerror})") from None
            raise InputError(f"{path}: cannot be opened ({error.strerror})") from None
        try:
            self.card, self.driver = self._identify()
        except BaseException:
            self.close()
            raise

    def call(self, request: int, argument: ctypes.Structure | ctypes.c_int32, purpose: str) -> None:
        """Make one ioctl, which may change `argument`.

        Raises
        ------
        CameraLost
            If the device is gone.
        InputError
            If another program uses it, or the bus has no room for the stream.
        OSError
            As the kernel gave it, for all else; `purpose` is put in front of its text.
        """
        try:
            fcntl.ioctl(self.fd, request, argument)
        except OSError as error:
            if error.errno in _GONE:
                raise CameraLost(f"{self.path}: the camera is gone ({error.strerror})") from None
            if error.errno == errno.EBUSY:
                raise InputError(
                    f"{self.path}: cannot {purpose}; another program is using the camera"
                ) from None
            if error.errno == errno.ENOSPC:
                raise InputError(
                    f"{self.path}: cannot {purpose}; the USB bus has no room for it: ask for a "
                    "smaller picture, a lower rate or MJPG"
                ) from None
            raise OSError(error.errno, f"{self.path}: cannot {purpose}: {error.strerror}") from None

    def close(self) -> None:
        """Close the descriptor; harmless if it is closed already."""
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _identify(self) -> tuple[str, str]:
        answer = kernel.Capability()
        try:
            self.call(kernel.QUERY_CAPABILITY, answer, "ask what it is")
        except OSError:
            raise InputError(f"{self.path}: not a video device") from None
        tells_own = answer.capabilities & kernel.HAS_DEVICE_CAPABILITIES
        abilities = answer.device_caps if tells_own else answer.capabilities
        card = device_text(answer.card)
        if not abilities & kernel.CAN_CAPTURE:
            reason = (
                "sends its planes in separate buffers, which is not supported"
                if abilities & kernel.CAN_CAPTURE_PLANES
                else "does not capture pictures; a camera's other node may"
            )
            raise InputError(f"{self.path} ({card}): {reason}")
        if not abilities & kernel.CAN_STREAM:
            raise InputError(f"{self.path} ({card}): cannot stream into buffers")
        return card, device_text(answer.driver)


def device_text(name: bytes) -> str:
    """Return a name that a device gave, without what would steer a terminal or spoil a manifest."""
    return printable(name.decode(errors="replace"))
