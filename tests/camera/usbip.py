"""A USB device in this process, plugged into the kernel's virtual hub (vhci-hcd) over USB/IP.

The kernel holds one end of a socket pair and sends each transfer that a driver asks for; we answer
on the other. Messages are those of the kernel's Documentation/usb/usbip_protocol.rst.

Input  : answers to control requests, data for one bulk endpoint.    Needs root and vhci-hcd.
Fails  : isochronous endpoints and bulk output are not there.
"""

import contextlib
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

HUB = Path("/sys/devices/platform/vhci_hcd.0")

_SUBMIT, _UNLINK, _SUBMITTED, _UNLINKED = 1, 2, 3, 4
_HEADER_BYTES = 48
_HIGH_SPEED = 3
_FREE_PORT = "004"
_LOOK_S = 0.05
_STALL, _CONNECTION_RESET = -32, -104


class Setup(NamedTuple):
    """The eight bytes that open a control transfer; `target` is an interface or endpoint."""

    request_type: int
    request: int
    value: int
    target: int
    length: int


Answer = Callable[[Setup, bytes], bytes | None]
"""Returns what the device sends back, b"" if nothing, or None to refuse (a stall)."""


class VirtualDevice:
    """A device in a port of the virtual hub, from construction until `unplug`."""

    def __init__(self, answer: Answer) -> None:
        self._answer = answer
        self._waiting: deque[tuple[int, int]] = deque()  # (sequence number, length) of bulk reads
        self._changed = threading.Condition()
        self.gone = False
        self._socket, kernel_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        with kernel_end:
            for end in (self._socket, kernel_end):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
            self._port = _free_port()
            device_id = 1 << 16 | self._port + 2  # bus and number, of which only we speak
            attachment = f"{self._port} {kernel_end.fileno()} {device_id} {_HIGH_SPEED}"
            (HUB / "attach").write_text(attachment)
        self._server = threading.Thread(target=self._serve, daemon=True)
        self._server.start()

    def unplug(self) -> None:
        """Pull the plug."""
        with contextlib.suppress(OSError):  # the kernel has detached it already
            (HUB / "detach").write_text(str(self._port))
        self._leave()
        self._server.join()
        self._socket.close()

    def send_bulk(self, data: bytes, still_wanted: Callable[[], bool]) -> bool:
        """Answer the next bulk read; False if the data are wanted no more before one comes."""
        with self._changed:
            while not self.gone and still_wanted():
                if not self._waiting:
                    self._changed.wait(_LOOK_S)
                    continue
                sequence, length = self._waiting.popleft()
                if len(data) > length:
                    raise ValueError(f"{len(data)} bytes for a read of {length}")
                # Under the lock: the kernel drops a device that answers a read it has withdrawn.
                self._reply(sequence, 0, data, len(data))
                return True
        return False

    def _serve(self) -> None:
        with contextlib.suppress(OSError, EOFError):
            while True:
                self._serve_one()
        self._leave()

    def _serve_one(self) -> None:
        header = self._receive(_HEADER_BYTES)
        command, sequence, _, is_input, endpoint = struct.unpack_from(">5I", header)
        if command == _UNLINK:
            self._withdraw(sequence, struct.unpack_from(">I", header, 20)[0])
            return
        (length,) = struct.unpack_from(">i", header, 24)
        data = b"" if is_input else self._receive(length)
        if endpoint:
            with self._changed:
                self._waiting.append((sequence, length))
                self._changed.notify_all()
            return
        answer = self._answer(Setup(*struct.unpack_from("<BBHHH", header, 40)), data)
        with self._changed:
            if answer is None:
                self._reply(sequence, _STALL, b"", 0)
            elif is_input:
                self._reply(sequence, 0, answer[:length], len(answer[:length]))
            else:
                self._reply(sequence, 0, b"", length)

    def _withdraw(self, sequence: int, victim: int) -> None:
        with self._changed:
            kept = [read for read in self._waiting if read[0] != victim]
            status = _CONNECTION_RESET if len(kept) < len(self._waiting) else 0
            self._waiting = deque(kept)
            self._socket.sendall(struct.pack(">5Ii24x", _UNLINKED, sequence, 0, 0, 0, status))

    def _reply(self, sequence: int, status: int, data: bytes, length: int) -> None:
        header = struct.pack(">5I5i8x", _SUBMITTED, sequence, 0, 0, 0, status, length, 0, 0, 0)
        with contextlib.suppress(OSError):  # unplugged meanwhile
            self._socket.sendall(header + data)

    def _receive(self, count: int) -> bytes:
        data = bytearray()
        while len(data) < count:
            part = self._socket.recv(count - len(data))
            if not part:
                raise EOFError
            data += part
        return bytes(data)

    def _leave(self) -> None:
        with self._changed:
            self.gone = True
            self._changed.notify_all()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)


def _free_port() -> int:
    for line in (HUB / "status").read_text().splitlines():
        hub, port, status, *_ = line.split()
        if hub == "hs" and status == _FREE_PORT:
            return int(port)
    raise OSError("every port of the virtual hub is taken")
