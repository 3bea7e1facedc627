"""An emulated USB camera: a device to the kernel, its light computed beforehand.

The stock uvcvideo driver makes /dev/videoN of it. What a program sets arrives here as real UVC
requests and shows in the pictures two or three frames later; every frame carries the truth
(uvc_stamp.py), and so does the log.

    python -S -m tests.camera.uvc_camera PICTURES LOG

Input  : lines on standard input: plug, unplug, stall, resume, corrupt, mend. Its end unplugs the
         camera.
Output : a line "ok" for each; at the end, LOG: a line of JSON for each frame and each setting.
Needs  : root, vhci-hcd, uvcvideo; nothing but Python's own modules.
Fails  : power-line frequency, the right to slow the stream and white balance in kelvins are kept
         but change nothing; brightness and automatic white balance change YUYV alone.
"""

import json
import struct
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tests.camera.usbip import Setup, VirtualDevice
from tests.camera.uvc_controls import (
    APERTURE_PRIORITY,
    GET_INFO,
    GET_LEN,
    SET_CUR,
    Controls,
    Settings,
)
from tests.camera.uvc_descriptors import (
    CLOCK_HZ,
    STREAMING_INTERFACE,
    StreamShape,
    configuration_descriptor,
    device_descriptor,
    string_descriptor,
)
from tests.camera.uvc_pictures import PictureBook, PictureKey
from tests.camera.uvc_stamp import Stamp, stamped

NAME = "Emulated Fisheye Camera"
STRINGS = ("fishlight", NAME, "F15HEYE0")
INTERVALS_100NS = (333_333, 500_000, 1_000_000)
LATENCY = 2
"""A frame shows the settings of the moment at which the frame this many earlier began."""

_PAYLOAD_BYTES = 16384
_UNIT_100NS = 1000  # of an exposure time
_STANDARD_IN, _CLASS_INTERFACE = 0x80, 0x21
_GET_STATUS, _CLEAR_FEATURE, _GET_DESCRIPTOR, _GET_CONFIGURATION, _GET_INTERFACE = 0, 1, 6, 8, 10
_TO_ENDPOINT = 2
_PROBE, _COMMIT = 1, 2
_END_OF_FRAME, _END_OF_HEADER = 0x02, 0x80
_COOL_CAST = 8


class Camera:
    """The camera; it is in the hub between `plug` and `unplug`."""

    def __init__(self, book: PictureBook) -> None:
        self._book = book
        self._shape = StreamShape(book.formats, book.size_px, INTERVALS_100NS)
        self._configuration = configuration_descriptor(self._shape)
        self.stalled = False
        self.corrupt = False
        self.frames: list[dict[str, float]] = []
        self.changes: list[tuple[float, str, int]] = []
        self._device: VirtualDevice | None = None
        self._sender: threading.Thread | None = None

    def plug(self) -> None:
        """Put the camera into the hub, all of its controls as they are from the factory."""
        self._controls = Controls(self._book.exposures, self._book.gain_count)
        self._controls.changes = self.changes
        self._stream = self._stream_state(1, INTERVALS_100NS[0])
        self._streaming = threading.Event()
        self._streams_begun = 0
        self._device = VirtualDevice(self._answer)
        self._sender = threading.Thread(target=self._send_frames, args=(self._device,), daemon=True)
        self._sender.start()

    def unplug(self) -> None:
        """Pull it out; harmless if it is out."""
        if self._device is None or self._sender is None:
            return
        self._device.unplug()
        self._sender.join()
        self._device = None

    def _answer(self, setup: Setup, data: bytes) -> bytes | None:
        kind, request, value, target, _ = setup
        if kind & 0x7F == _CLASS_INTERFACE:
            selector, entity = value >> 8, target >> 8
            if target & 0xFF == STREAMING_INTERFACE:
                return self._negotiate(request, selector, data)
            return self._controls.answer(request, entity, selector, data)
        if kind & _STANDARD_IN:
            return self._standard(request, value)
        if kind & 0x1F == _TO_ENDPOINT and request == _CLEAR_FEATURE:
            self._streaming.clear()  # so a driver ends a bulk stream
        return b""

    def _standard(self, request: int, value: int) -> bytes | None:
        if request != _GET_DESCRIPTOR:
            return {_GET_STATUS: b"\1\0", _GET_CONFIGURATION: b"\1", _GET_INTERFACE: b"\0"}.get(
                request
            )
        kind, index = value >> 8, value & 0xFF
        if kind == 3:
            return string_descriptor(index, STRINGS)
        return {1: device_descriptor(), 2: self._configuration}.get(kind)

    def _negotiate(self, request: int, selector: int, data: bytes) -> bytes | None:
        """Answer about format and rate: a driver probes what it would get, then commits to it."""
        if selector not in (_PROBE, _COMMIT):
            return None
        if request == SET_CUR:
            _, format_index, _, interval = struct.unpack_from("<HBBI", data)
            self._stream = self._stream_state(format_index, interval)
            if selector == _COMMIT:
                self._streams_begun += 1
                self._streaming.set()
            return b""
        if request == GET_LEN:
            return struct.pack("<H", len(self._stream))
        return b"\3" if request == GET_INFO else self._stream

    def _stream_state(self, format_index: int, interval: int) -> bytes:
        index = min(max(format_index, 1), len(self._shape.formats))
        nearest = min(INTERVALS_100NS, key=lambda possible: abs(possible - interval))
        most = self._shape.frame_bytes(self._shape.formats[index - 1])
        return struct.pack(
            "<HBBI5HIIIBBBB",
            *(1, index, 1, nearest, 0, 0, 0, 0, 50, most, _PAYLOAD_BYTES, CLOCK_HZ, 3, 0, 0, 0),
        )

    def _send_frames(self, device: VirtualDevice) -> None:
        begun: deque[Settings] = deque(maxlen=LATENCY + 1)
        automatic = self._book.exposures[0]
        due_s = time.monotonic()
        while not device.gone:
            if self.stalled or not self._streaming.wait(0.05):
                begun.clear()
                time.sleep(0.01)
                due_s = time.monotonic()
                continue
            stream = self._streams_begun
            _, format_index, _, interval = struct.unpack_from("<HBBI", self._stream)
            pixel_format = self._shape.formats[format_index - 1]
            begun.append(self._controls.settings())
            settings = begun[0]
            is_automatic = settings.exposure_mode == APERTURE_PRIORITY
            if is_automatic:
                automatic = self._step_towards_automatic(automatic)
            exposure = automatic if is_automatic else settings.exposure
            # A long exposure slows the stream.
            due_s += max(interval, exposure * _UNIT_100NS) * 1e-7
            key = PictureKey(pixel_format, exposure, settings.gain)
            data = self._finished(key, settings, len(self.frames))
            time.sleep(max(0.0, due_s - time.monotonic()))
            due_s = max(due_s, time.monotonic() - interval * 1e-7)
            is_automatic = is_automatic or bool(settings.white_balance_auto)
            facts: dict[str, float] = {"exposure": exposure, "automatic": is_automatic}
            self._send(device, data, facts, partial(self._runs, stream))

    def _runs(self, stream: int) -> bool:
        return self._streaming.is_set() and stream == self._streams_begun

    def _step_towards_automatic(self, exposure: int) -> int:
        steps = self._book.exposures
        here, there = steps.index(exposure), steps.index(self._book.auto_exposure)
        return steps[here + (there > here) - (there < here)]

    def _finished(self, key: PictureKey, settings: Settings, number: int) -> bytes:
        picture = self._book.picture(key, number)
        if key.pixel_format == "YUYV":
            cast = _COOL_CAST if settings.white_balance_auto else 0
            for start, step, offset in ((0, 2, settings.brightness), (1, 4, cast), (3, 4, -cast)):
                if offset:
                    picture[start::step] = picture[start::step].translate(_shifted(offset))
        stamp = Stamp(number & 0xFFFF, key.exposure, key.gain)
        return stamped(picture, key.pixel_format, self._shape.size_px[0], stamp)

    def _send(
        self,
        device: VirtualDevice,
        data: bytes,
        facts: dict[str, float],
        still_wanted: Callable[[], bool],
    ) -> None:
        number = len(self.frames)
        facts |= {"frame": number, "corrupt": self.corrupt}
        begun_s = time.monotonic()
        if self.corrupt:
            data = data[: len(data) * 3 // 5]
        size = _PAYLOAD_BYTES - 2
        starts = range(0, len(data), size)
        sent = True
        for start in starts:
            flags = _END_OF_HEADER | number & 1 | (_END_OF_FRAME if start == starts[-1] else 0)
            payload = bytes((2, flags)) + data[start : start + size]
            sent = sent and device.send_bulk(payload, still_wanted)
        self.frames.append({**facts, "time_s": begun_s, "sent": sent})


def _shifted(offset: int) -> bytes:
    return bytes(min(max(value + offset, 0), 255) for value in range(256))


def main(pictures: Path, log: Path) -> None:
    """Obey standard input."""
    camera = Camera(PictureBook(pictures))
    for line in sys.stdin:
        match line.strip():
            case "plug":
                camera.plug()
            case "unplug":
                camera.unplug()
            case "stall":
                camera.stalled = True
            case "resume":
                camera.stalled = False
            case "corrupt":
                camera.corrupt = True
            case "mend":
                camera.corrupt = False
            case other:
                raise SystemExit(f"no such command: {other}")
        print("ok", flush=True)
    camera.unplug()
    changes = [{"time_s": at, "set": name, "value": value} for at, name, value in camera.changes]
    log.write_text("".join(json.dumps(line) + "\n" for line in [*camera.frames, *changes]))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
