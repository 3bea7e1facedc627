"""The kernel's side of Video4Linux 2: request numbers and structures of linux/videodev2.h.

Domain : 64-bit Linux. A request number carries the size of its structure, so a layout that is
         wrong is refused by the kernel (ENOTTY) instead of being misread.
"""

import ctypes
from ctypes import c_char, c_int32, c_int64, c_long, c_uint8, c_uint32, c_uint64

VIDEO_CAPTURE = 1  # enum v4l2_buf_type
MEMORY_MMAP = 1
FIELD_NONE = 1
DISCRETE = 1  # both of v4l2_frmsizetypes and of v4l2_frmivaltypes

CAN_CAPTURE = 0x0000_0001
CAN_CAPTURE_PLANES = 0x0000_1000
CAN_STREAM = 0x0400_0000
HAS_DEVICE_CAPABILITIES = 0x8000_0000
HAS_FRAME_INTERVAL = 0x1000

BUFFER_ERROR = 0x0040
TIMESTAMP_MASK = 0xE000
TIMESTAMP_MONOTONIC = 0x2000

NEXT_CONTROL = 0x8000_0000
CONTROL_DISABLED, CONTROL_READ_ONLY = 0x0001, 0x0004
INTEGER, BOOLEAN, MENU, INTEGER64, INTEGER_MENU = 1, 2, 3, 5, 9


class Capability(ctypes.Structure):
    """What VIDIOC_QUERYCAP tells of a device."""

    _fields_ = (
        ("driver", c_char * 16),
        ("card", c_char * 32),
        ("bus_info", c_char * 32),
        ("version", c_uint32),
        ("capabilities", c_uint32),
        ("device_caps", c_uint32),
        ("reserved", c_uint32 * 3),
    )


class FormatDescription(ctypes.Structure):
    """One pixel format that a device offers."""

    _fields_ = (
        ("index", c_uint32),
        ("type", c_uint32),
        ("flags", c_uint32),
        ("description", c_char * 32),
        ("pixelformat", c_uint32),
        ("mbus_code", c_uint32),
        ("reserved", c_uint32 * 3),
    )


class Format(ctypes.Structure):
    """A picture's format: v4l2_format with its v4l2_pix_format."""

    _fields_ = (
        ("type", c_uint32),
        ("_align", c_uint32),  # the union holds pointers
        ("width", c_uint32),
        ("height", c_uint32),
        ("pixelformat", c_uint32),
        ("field", c_uint32),
        ("bytesperline", c_uint32),
        ("sizeimage", c_uint32),
        ("colorspace", c_uint32),
        ("priv", c_uint32),
        ("flags", c_uint32),
        ("ycbcr_enc", c_uint32),
        ("quantization", c_uint32),
        ("xfer_func", c_uint32),
        ("_rest", c_uint8 * 152),
    )


class StreamParameters(ctypes.Structure):
    """The frame interval: v4l2_streamparm with its v4l2_captureparm."""

    _fields_ = (
        ("type", c_uint32),
        ("capability", c_uint32),
        ("capturemode", c_uint32),
        ("numerator", c_uint32),
        ("denominator", c_uint32),
        ("_rest", c_uint8 * 184),
    )


class FrameSize(ctypes.Structure):
    """One size of a format; stepwise ones go from a smallest to a largest."""

    _fields_ = (
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("type", c_uint32),
        ("values", c_uint32 * 6),  # discrete: width, height; else min, max, step of each
        ("reserved", c_uint32 * 2),
    )


class FrameInterval(ctypes.Structure):
    """One frame interval of a size; stepwise ones go from a shortest to a longest."""

    _fields_ = (
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("type", c_uint32),
        ("values", c_uint32 * 6),  # fractions: the interval, or the shortest, longest and step
        ("reserved", c_uint32 * 2),
    )


class BufferRequest(ctypes.Structure):
    """How many buffers the driver keeps for this stream."""

    _fields_ = (
        ("count", c_uint32),
        ("type", c_uint32),
        ("memory", c_uint32),
        ("capabilities", c_uint32),
        ("flags", c_uint8),
        ("reserved", c_uint8 * 3),
    )


class Buffer(ctypes.Structure):
    """One buffer: where it lies, and what is in it."""

    _fields_ = (
        ("index", c_uint32),
        ("type", c_uint32),
        ("bytesused", c_uint32),
        ("flags", c_uint32),
        ("field", c_uint32),
        ("seconds", c_long),
        ("microseconds", c_long),
        ("timecode", c_uint32 * 4),
        ("sequence", c_uint32),
        ("memory", c_uint32),
        ("offset", c_uint32),
        ("_align", c_uint32),  # the union holds pointers
        ("length", c_uint32),
        ("reserved2", c_uint32),
        ("request_fd", c_int32),
    )


class ControlQuery(ctypes.Structure):
    """What a control is: v4l2_query_ext_ctrl."""

    _fields_ = (
        ("id", c_uint32),
        ("type", c_uint32),
        ("name", c_char * 32),
        ("minimum", c_int64),
        ("maximum", c_int64),
        ("step", c_uint64),
        ("default_value", c_int64),
        ("flags", c_uint32),
        ("elem_size", c_uint32),
        ("elems", c_uint32),
        ("nr_of_dims", c_uint32),
        ("dims", c_uint32 * 4),
        ("reserved", c_uint32 * 32),
    )


class MenuQuery(ctypes.Structure):
    """One entry of a menu control; `name` of an integer menu holds a 64-bit number."""

    _pack_ = 1
    _fields_ = (
        ("id", c_uint32),
        ("index", c_uint32),
        ("name", c_char * 32),
        ("reserved", c_uint32),
    )


class ControlValue(ctypes.Structure):
    """A control's value: v4l2_ext_control. Those of 32 bits use the low half, sign-extended."""

    _pack_ = 1
    _fields_ = (
        ("id", c_uint32),
        ("size", c_uint32),
        ("reserved2", c_uint32),
        ("value64", c_int64),
    )


class ControlValues(ctypes.Structure):
    """A set of control values to read or write at once; `which` 0 means the current ones."""

    _fields_ = (
        ("which", c_uint32),
        ("count", c_uint32),
        ("error_idx", c_uint32),
        ("request_fd", c_int32),
        ("reserved", c_uint32),
        ("controls", ctypes.POINTER(ControlValue)),
    )


_WRITE, _READ = 1, 2


def _request(direction: int, number: int, structure: type[ctypes.Structure | c_int32]) -> int:
    return direction << 30 | ctypes.sizeof(structure) << 16 | ord("V") << 8 | number


QUERY_CAPABILITY = _request(_READ, 0, Capability)
ENUMERATE_FORMATS = _request(_READ | _WRITE, 2, FormatDescription)
GET_FORMAT = _request(_READ | _WRITE, 4, Format)
SET_FORMAT = _request(_READ | _WRITE, 5, Format)
REQUEST_BUFFERS = _request(_READ | _WRITE, 8, BufferRequest)
QUERY_BUFFER = _request(_READ | _WRITE, 9, Buffer)
QUEUE_BUFFER = _request(_READ | _WRITE, 15, Buffer)
DEQUEUE_BUFFER = _request(_READ | _WRITE, 17, Buffer)
STREAM_ON = _request(_WRITE, 18, c_int32)
STREAM_OFF = _request(_WRITE, 19, c_int32)
GET_PARAMETERS = _request(_READ | _WRITE, 21, StreamParameters)
SET_PARAMETERS = _request(_READ | _WRITE, 22, StreamParameters)
QUERY_MENU = _request(_READ | _WRITE, 37, MenuQuery)
GET_CONTROLS = _request(_READ | _WRITE, 71, ControlValues)
SET_CONTROLS = _request(_READ | _WRITE, 72, ControlValues)
ENUMERATE_SIZES = _request(_READ | _WRITE, 74, FrameSize)
ENUMERATE_INTERVALS = _request(_READ | _WRITE, 75, FrameInterval)
QUERY_CONTROL = _request(_READ | _WRITE, 103, ControlQuery)


def fourcc(name: str) -> int:
    """Return the kernel's number of a four-character code, "Y16" being "Y16 "."""
    return int.from_bytes(name.ljust(4).encode("ascii"), "little")


def fourcc_name(number: int) -> str:
    """Return the four-character code of the kernel's number, without trailing spaces."""
    return number.to_bytes(4, "little").decode("latin-1").rstrip()
