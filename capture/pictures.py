"""Camera pictures with 8 or 16 bits a channel: JPEG, PNG and TIFF, read strictly and written whole.

Input  : a file.    Output : counts in DN, (H, W, 3), R, G, B.
Pixels come as they are stored. The EXIF orientation is not applied: a calibration holds for the
sensor's rows and columns, however the camera was held.
Fails  : a JPEG or TIFF whose compressed data were altered, not cut, may decode to wrong pixels
         without a word; a recording's digests tell.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError, UnreadableFrame
from capture.files import check_size, read_bytes
from capture.output import replacing
from capture.picture_header import PictureHeader, parse_header

PICTURE_SUFFIXES = frozenset((".jpg", ".jpeg", ".png", ".tif", ".tiff"))

_AS_STORED = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
_BGR_AS_STORED = cv2.IMREAD_COLOR_BGR | _AS_STORED
_RGB_AS_STORED = cv2.IMREAD_COLOR_RGB | _AS_STORED


def read_picture(path: Path) -> NDArray[Any]:
    """Return the counts of a picture, (H, W, 3) uint8 or uint16 in R, G, B order.

    Grey is repeated to three channels; an alpha channel that is opaque everywhere is dropped.

    Raises
    ------
    UnreadableFrame
        If the file is not a complete JPEG, PNG or TIFF, or has more than 2^27 pixels.
    InputError
        If the file does not exist, or has transparent pixels.
    """
    data = read_bytes(path)
    header = _header(path, data)
    if header.has_alpha:
        flags, swap = cv2.IMREAD_UNCHANGED, cv2.COLOR_BGRA2RGB
    elif header.bits == 8:
        flags, swap = _RGB_AS_STORED, None
    else:  # OpenCV 5.0 scrambles 16-bit TIFF with IMREAD_COLOR_RGB
        flags, swap = _BGR_AS_STORED, cv2.COLOR_BGR2RGB
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise UnreadableFrame(f"{path}: damaged {header.format} ({error.err})") from None
    channels = 3 + header.has_alpha
    expected = (header.height_px, header.width_px, channels)
    if picture is None or picture.shape != expected or picture.dtype.itemsize * 8 != header.bits:
        raise UnreadableFrame(f"{path}: damaged {header.format}: its pixels cannot be decoded")
    if header.has_alpha and picture[..., 3].min() < 2**header.bits - 1:
        raise InputError(
            f"{path}: has transparent pixels, whose counts mean nothing; flatten the picture first"
        )
    return picture if swap is None else cv2.cvtColor(picture, swap)


def picture_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of a picture from its header; raises as `read_picture` does."""
    header = _header(path, read_bytes(path))
    return header.width_px, header.height_px


def write_png(path: Path, picture: NDArray[Any], *, force: bool = True) -> None:
    """Write a picture, (H, W, 3) RGB or (H, W, 4) RGBA, uint8 or uint16, as PNG without loss."""
    _write(path, picture, ".png", [cv2.IMWRITE_PNG_COMPRESSION, 4], force=force)


def write_jpeg(
    path: Path, picture: NDArray[np.uint8], quality: int = 95, *, force: bool = True
) -> None:
    """Write a picture, (H, W, 3) uint8 RGB, as JPEG of the given quality, 1 to 100.

    Colour is kept at full resolution (4:4:4): the counts are measurements.
    """
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise ValueError(f"a JPEG takes (H, W, 3) uint8, got {picture.shape} {picture.dtype}")
    sampling = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    _write(path, picture, ".jpg", [cv2.IMWRITE_JPEG_QUALITY, quality, *sampling], force=force)


def _header(path: Path, data: bytes) -> PictureHeader:
    try:
        header = parse_header(data)
    except ValueError as error:
        raise UnreadableFrame(f"{path}: {error}") from None
    check_size(path, header.width_px, header.height_px)
    return header


def _write(
    path: Path, picture: NDArray[Any], suffix: str, options: list[int], *, force: bool
) -> None:
    if picture.ndim != 3 or picture.shape[2] not in (3, 4):
        raise ValueError(f"a picture must be (H, W, 3) or (H, W, 4), got {picture.shape}")
    if picture.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"a picture must be uint8 or uint16, got {picture.dtype}")
    to_bgr = cv2.COLOR_RGB2BGR if picture.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    encoded = cv2.imencode(suffix, cv2.cvtColor(picture, to_bgr), options)[1]
    with replacing(path, force=force) as partial:
        partial.write_bytes(encoded.tobytes())
