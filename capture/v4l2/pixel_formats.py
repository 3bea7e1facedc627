"""What the bytes of a frame mean, for every pixel format that is supported.

Input  : a frame's bytes and its PictureFormat.    Output : counts in DN, (H, W, 3), R, G, B.
Fails  : 8-bit colour has the camera's own tone curve; it is taken for sRGB until it is measured.
"""

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.errors import UnreadableFrame
from capture.picture_header import parse_header
from capture.sensor import Sensor, assumed_sensor
from capture.v4l2.bayer import rgb_from_mosaic, unpack_10, unpack_12
from capture.v4l2.formats import PictureFormat
from capture.v4l2.yuv import full_range_luma, rgb_from_yuv

_SAMPLES = 4096
"""How many pixels are looked at to judge a frame's exposure."""

_RAW_SPACE, _LINEAR = 11, 5  # V4L2_COLORSPACE_RAW, V4L2_XFER_FUNC_NONE


@dataclass(frozen=True)
class _Layout:
    kind: Literal["yuv", "nv12", "jpeg", "grey", "bayer", "rgb"]
    bits: int = 8
    order: str = ""  # of colours in a mosaic, of bytes in a pixel
    is_packed: bool = False


_LAYOUTS = {
    "YUYV": _Layout("yuv", order="YUYV"),
    "UYVY": _Layout("yuv", order="UYVY"),
    "NV12": _Layout("nv12"),
    "MJPG": _Layout("jpeg"),
    "JPEG": _Layout("jpeg"),
    "RGB3": _Layout("rgb", order="RGB"),
    "BGR3": _Layout("rgb", order="BGR"),
    "GREY": _Layout("grey"),
    "Y10": _Layout("grey", 10),
    "Y12": _Layout("grey", 12),
    "Y16": _Layout("grey", 16),
    "BA81": _Layout("bayer", 8, "BGGR"),
    "GBRG": _Layout("bayer", 8, "GBRG"),
    "GRBG": _Layout("bayer", 8, "GRBG"),
    "RGGB": _Layout("bayer", 8, "RGGB"),
    "BG10": _Layout("bayer", 10, "BGGR"),
    "GB10": _Layout("bayer", 10, "GBRG"),
    "BA10": _Layout("bayer", 10, "GRBG"),
    "RG10": _Layout("bayer", 10, "RGGB"),
    "pBAA": _Layout("bayer", 10, "BGGR", is_packed=True),
    "pGAA": _Layout("bayer", 10, "GBRG", is_packed=True),
    "pgAA": _Layout("bayer", 10, "GRBG", is_packed=True),
    "pRAA": _Layout("bayer", 10, "RGGB", is_packed=True),
    "BG12": _Layout("bayer", 12, "BGGR"),
    "GB12": _Layout("bayer", 12, "GBRG"),
    "BA12": _Layout("bayer", 12, "GRBG"),
    "RG12": _Layout("bayer", 12, "RGGB"),
    "pBCC": _Layout("bayer", 12, "BGGR", is_packed=True),
    "pGCC": _Layout("bayer", 12, "GBRG", is_packed=True),
    "pgCC": _Layout("bayer", 12, "GRBG", is_packed=True),
    "pRCC": _Layout("bayer", 12, "RGGB", is_packed=True),
    "BYR2": _Layout("bayer", 16, "BGGR"),
    "GB16": _Layout("bayer", 16, "GBRG"),
    "GR16": _Layout("bayer", 16, "GRBG"),
    "RG16": _Layout("bayer", 16, "RGGB"),
}

PIXEL_FORMATS = frozenset(_LAYOUTS)
"""Four-character codes of what can be decoded."""


def pixel_sensor(picture: PictureFormat, brightest_dn: int) -> Sensor:
    """Return the sensor that a pixel format implies, black at 0.

    Colour of 8 bits is taken for sRGB-coded; mosaics, and grey that has more bits or that the
    driver calls linear, are linear. Formats of 16 bits do not tell how many of them the camera
    fills: white is then the end of the least number of bits that holds `brightest_dn`, the largest
    sample of a long exposure. Too low, it only marks light as clipped that was not.
    """
    layout = _LAYOUTS[picture.fourcc]
    told_linear = picture.xfer_func == _LINEAR or picture.colorspace == _RAW_SPACE
    if layout.kind != "bayer" and layout.bits == 8 and not (layout.kind == "grey" and told_linear):
        return assumed_sensor(np.uint8)
    bits = layout.bits
    if bits == 16:
        bits = next(bits for bits in (10, 12, 14, 16) if brightest_dn < 2**bits)
    source = f"linear {picture.fourcc}, white taken at {bits} bits and black at 0"
    if layout.kind == "bayer":
        source += ", in the sensor's own colours"
    return Sensor(0.0, 2.0**bits - 1, source=source)


def decode(data: bytes, picture: PictureFormat, sensor: Sensor) -> NDArray[Any]:
    """Return a frame's counts, (H, W, 3), uint8 or uint16.

    Raises
    ------
    UnreadableFrame
        If data are missing, a JPEG is damaged, or a sample lies above the sensor's white.
    """
    layout = _LAYOUTS[picture.fourcc]
    if layout.kind == "jpeg":
        return _decode_jpeg(data, picture, cv2.IMREAD_COLOR_RGB)
    if layout.kind == "yuv":
        return rgb_from_yuv(_packed_yuv(data, picture, layout.order), picture)
    if layout.kind == "nv12":
        return rgb_from_yuv(_nv12(data, picture), picture)
    if layout.kind == "rgb":
        pixels = _rows(data, picture, 3 * picture.size_px[0]).reshape(*_shape(picture), 3)
        return np.ascontiguousarray(pixels if layout.order == "RGB" else pixels[..., ::-1])
    samples = _samples(data, picture, layout)
    if samples.dtype == np.uint16 and samples.max() > sensor.white_dn:
        raise UnreadableFrame(
            f"a sample of {samples.max()} lies above white, {sensor.white_dn:g}: open the camera "
            "again with bright light in the picture"
        )
    if layout.kind == "bayer":
        return rgb_from_mosaic(samples, layout.order, sensor)
    return np.asarray(cv2.cvtColor(samples, cv2.COLOR_GRAY2RGB))


def exposure_samples(data: bytes, picture: PictureFormat) -> NDArray[Any]:
    """Return brightness in DN at about 4096 pixels, always the same: green, grey or luma.

    Raises
    ------
    UnreadableFrame
        If data are missing, or a JPEG is damaged.
    """
    layout = _LAYOUTS[picture.fourcc]
    width = picture.size_px[0]
    if layout.kind == "jpeg":
        # An eighth of the size is what the coarse coefficients hold: no more is decoded.
        plane = _decode_jpeg(data, picture, cv2.IMREAD_REDUCED_GRAYSCALE_8)
    elif layout.kind in ("yuv", "nv12"):
        is_planar = layout.kind == "nv12"
        rows = _rows(data, picture, width if is_planar else 2 * width)
        plane = rows if is_planar else rows[:, layout.order.index("Y") :: 2]
    elif layout.kind == "rgb":
        plane = _rows(data, picture, 3 * width)[:, 1::3]
    elif layout.kind == "bayer":
        green = layout.order.index("G")  # 0 or 1: the first row's green pixels
        plane = _samples(data, picture, layout)[::2, green::2]
    else:
        plane = _samples(data, picture, layout)
    step = max(1, int((plane.size / _SAMPLES) ** 0.5))
    chosen = plane[step // 2 :: step, step // 2 :: step].ravel()
    return full_range_luma(chosen, picture) if layout.kind in ("yuv", "nv12") else chosen


def brightest_sample(data: bytes, picture: PictureFormat) -> int:
    """Return the largest sample of a grey or mosaic frame; 255 of other formats."""
    layout = _LAYOUTS[picture.fourcc]
    if layout.kind not in ("grey", "bayer"):
        return 255
    return int(_samples(data, picture, layout).max())


def _shape(picture: PictureFormat) -> tuple[int, int]:
    width, height = picture.size_px
    return height, width


def _rows(
    data: bytes, picture: PictureFormat, row_bytes: int, height: int | None = None, first: int = 0
) -> NDArray[np.uint8]:
    """Return (H, row_bytes) bytes from `first` on, without what pads each row.

    The last row may come without its padding.
    """
    height = height or picture.size_px[1]
    stride = max(picture.bytes_per_line, row_bytes)
    wanted = first + stride * (height - 1) + row_bytes
    if len(data) < wanted:
        raise UnreadableFrame(f"the frame breaks off: {len(data)} bytes of {wanted}")
    values = np.frombuffer(data, np.uint8, wanted - first, first)
    return np.lib.stride_tricks.as_strided(values, (height, row_bytes), (stride, 1))


def _samples(data: bytes, picture: PictureFormat, layout: _Layout) -> NDArray[Any]:
    """Return one sample a pixel, (H, W) uint8 or uint16."""
    width = picture.size_px[0]
    if layout.bits == 8:
        return np.ascontiguousarray(_rows(data, picture, width))
    if layout.is_packed:
        group_px, group_bytes = (4, 5) if layout.bits == 10 else (2, 3)
        rows = _rows(data, picture, -(-width // group_px) * group_bytes)
        unpack = unpack_10 if layout.bits == 10 else unpack_12
        return np.ascontiguousarray(unpack(rows, width))
    rows = np.ascontiguousarray(_rows(data, picture, 2 * width))
    return rows.view("<u2").astype(np.uint16, copy=False)


def _packed_yuv(data: bytes, picture: PictureFormat, order: str) -> NDArray[np.uint8]:
    rows = _rows(data, picture, 2 * picture.size_px[0])
    yuv = np.empty((*_shape(picture), 3), np.uint8)
    yuv[..., 0] = rows[:, order.index("Y") :: 2]
    for channel, name in enumerate("UV", start=1):
        chroma = rows[:, order.index(name) :: 4]
        yuv[:, 0::2, channel] = chroma
        yuv[:, 1::2, channel] = chroma
    return yuv


def _nv12(data: bytes, picture: PictureFormat) -> NDArray[np.uint8]:
    width, height = picture.size_px
    stride = max(picture.bytes_per_line, width)
    yuv = np.empty((height, width, 3), np.uint8)
    yuv[..., 0] = _rows(data, picture, width)
    chroma = _rows(data, picture, width, height // 2, first=stride * height)
    pairs = chroma.reshape(height // 2, width // 2, 2)
    yuv[..., 1:] = pairs.repeat(2, axis=0).repeat(2, axis=1)
    return yuv


def _decode_jpeg(data: bytes, picture: PictureFormat, flags: int) -> NDArray[np.uint8]:
    """Return a complete JPEG's pixels; cameras leave out the tables, which decoders then supply."""
    try:
        header = parse_header(data)
    except ValueError as error:
        raise UnreadableFrame(f"the frame's JPEG is {error}") from None
    if (header.width_px, header.height_px) != picture.size_px:
        raise UnreadableFrame(
            f"the frame's JPEG is {header.width_px}×{header.height_px}, not "
            f"{picture.size_px[0]}×{picture.size_px[1]} px"
        )
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise UnreadableFrame(f"the frame's JPEG is damaged ({error.err})") from None
    if pixels is None:
        raise UnreadableFrame("the frame's JPEG is damaged: its pixels cannot be decoded")
    return np.asarray(pixels, np.uint8)
