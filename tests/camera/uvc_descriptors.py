"""The descriptors by which a USB camera tells a driver what it can do (USB Video Class 1.1).

One input terminal (the camera, with its exposure controls), one processing unit (gain and the
like), one output terminal, and a stream of several formats over a bulk endpoint.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

CAMERA_TERMINAL, PROCESSING_UNIT, _OUTPUT_TERMINAL = 1, 2, 3
CONTROL_INTERFACE, STREAMING_INTERFACE = 0, 1
CLOCK_HZ = 48_000_000

_DEVICE, _CONFIGURATION, _STRING, _INTERFACE, _ENDPOINT, _ASSOCIATION = 1, 2, 3, 4, 5, 11
_CLASS_SPECIFIC = 0x24
_VIDEO = 14
_GUID_TAIL = bytes.fromhex("00001000800000aa00389b71")
_NAME_IN_GUID = {"YUYV": b"YUY2", "GREY": b"Y800", "RG16": b"RG16"}
BITS_PER_PIXEL = {"YUYV": 16, "GREY": 8, "RG16": 16, "MJPG": 16}

_BT709_PRIMARIES, _SRGB_CURVE, _BT601_MATRIX = 1, 7, 4

EXPOSURE_BITS = 1 << 1 | 1 << 2 | 1 << 3
"""Auto-exposure mode, its priority over the frame rate, exposure time."""

PROCESSING_BITS = 1 << 0 | 1 << 6 | 1 << 9 | 1 << 10 | 1 << 12
"""Brightness, white balance, gain, power-line frequency, automatic white balance."""


@dataclass(frozen=True)
class StreamShape:
    """What the stream offers: every format in the one size at every interval."""

    formats: tuple[str, ...]
    size_px: tuple[int, int]
    intervals_100ns: tuple[int, ...]

    def frame_bytes(self, pixel_format: str) -> int:
        """Bytes of an uncompressed frame; of a compressed one, the most that it may take."""
        return self.size_px[0] * self.size_px[1] * BITS_PER_PIXEL[pixel_format] // 8


def device_descriptor() -> bytes:
    """Return the device's: USB 2.0, functions grouped by an association, three strings."""
    association = (0xEF, 2, 1)
    fields = (0x200, *association, 64, 0x1209, 0xF15E, 0x100, 1, 2, 3, 1)
    return _descriptor(_DEVICE, "HBBBBHHHBBBB", *fields)


def string_descriptor(index: int, strings: Sequence[str]) -> bytes | None:
    """Return string `index` from 1 on, or the list of languages for 0 (English alone)."""
    if index == 0:
        return _descriptor(_STRING, "H", 0x0409)
    if index > len(strings):
        return None
    text = strings[index - 1].encode("utf-16le")
    return _descriptor(_STRING, f"{len(text)}s", text)


def configuration_descriptor(shape: StreamShape) -> bytes:
    """Return the configuration with everything in it."""
    control = _control_interface()
    streaming = _streaming_interface(shape)
    association = _descriptor(_ASSOCIATION, "6B", CONTROL_INTERFACE, 2, _VIDEO, 3, 0, 2)
    body = association + control + streaming
    return _descriptor(_CONFIGURATION, "HBBBBB", 9 + len(body), 2, 1, 0, 0x80, 250) + body


def _control_interface() -> bytes:
    interface = _descriptor(_INTERFACE, "7B", CONTROL_INTERFACE, 0, 0, _VIDEO, 1, 0, 2)
    camera = _class_specific(
        *(2, "BHBBHHHB3s", CAMERA_TERMINAL, 0x0201, 0, 0, 0, 0, 0, 3),
        EXPOSURE_BITS.to_bytes(3, "little"),
    )
    processing = _class_specific(
        *(5, "BBHB2sBB", PROCESSING_UNIT, CAMERA_TERMINAL, 0, 2),
        *(PROCESSING_BITS.to_bytes(2, "little"), 0, 0),
    )
    output = _class_specific(3, "BHBBB", _OUTPUT_TERMINAL, 0x0101, 0, PROCESSING_UNIT, 0)
    units = camera + processing + output
    header = _class_specific(1, "HHIBB", 0x0110, 13 + len(units), CLOCK_HZ, 1, STREAMING_INTERFACE)
    return interface + header + units


def _streaming_interface(shape: StreamShape) -> bytes:
    interface = _descriptor(_INTERFACE, "7B", STREAMING_INTERFACE, 0, 1, _VIDEO, 2, 0, 0)
    formats = b"".join(_format(index, name, shape) for index, name in enumerate(shape.formats, 1))
    count = len(shape.formats)
    endpoint = 0x81
    header = _class_specific(
        *(1, f"BHBBBBBBB{count}s", count, 13 + count + len(formats), endpoint),
        *(0, _OUTPUT_TERMINAL, 0, 0, 0, 1, bytes(count)),
    )
    bulk = _descriptor(_ENDPOINT, "BBHB", endpoint, 2, 512, 0)
    return interface + header + formats + bulk


def _format(index: int, name: str, shape: StreamShape) -> bytes:
    is_jpeg = name == "MJPG"
    if is_jpeg:
        head = _class_specific(6, "8B", index, 1, 0, 1, 0, 0, 0, 0)
    else:
        head = _class_specific(
            *(4, "BB16s6B", index, 1, _NAME_IN_GUID[name] + _GUID_TAIL),
            *(BITS_PER_PIXEL[name], 1, 0, 0, 0, 0),
        )
    size = shape.frame_bytes(name)
    rates = [size * 8 * 10_000_000 // interval for interval in shape.intervals_100ns]
    intervals = shape.intervals_100ns
    frame = _class_specific(
        *(7 if is_jpeg else 5, f"BBHHIIIIB{len(intervals)}I", 1, 0, *shape.size_px),
        *(min(rates), max(rates), size, intervals[0], len(intervals), *intervals),
    )
    colour = _class_specific(0x0D, "BBB", _BT709_PRIMARIES, _SRGB_CURVE, _BT601_MATRIX)
    return head + frame + colour


def _descriptor(kind: int, form: str, *values: object) -> bytes:
    body = struct.pack("<" + form, *values)
    return struct.pack("BB", 2 + len(body), kind) + body


def _class_specific(subtype: int, form: str, *values: object) -> bytes:
    return _descriptor(_CLASS_SPECIFIC, "B" + form, subtype, *values)
