"""OpenEXR files: named channels of float32 pixels, and attributes.

Input  : a single-part file, scan lines or tiles, of any compression.
Output : a dictionary of channels; written as float32 scan lines with ZIP compression, which is
         exact. (Half floats end at 65504, below an unclipped sun.)
Fails  : a byte changed inside compressed pixels often still decodes; only a digest tells.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from capture.errors import InputError, UnreadableFrame
from capture.files import MAX_PIXELS, check_size, read_bytes
from capture.output import replacing


@dataclass(frozen=True)
class ExrFile:
    """An OpenEXR picture.

    Attributes
    ----------
    channels : dict of str to (H, W) float32
        The pixels of the display window; half and integer channels are widened.
    attributes : dict
        The header, without its list of channels.
    """

    channels: dict[str, NDArray[np.float32]]
    attributes: dict[str, Any]


def read_exr(path: Path) -> ExrFile:
    """Return the channels and attributes of an OpenEXR file.

    Pixels outside the display window (overscan) are cut off.

    Raises
    ------
    UnreadableFrame
        If the file is truncated, damaged, no OpenEXR file, or larger than any picture.
    InputError
        If it does not exist, or is of a kind that is not read: several parts, deep pixels,
        subsampled channels, or pixels for a part of the display window only.
    """
    _check_layout(path, read_bytes(path))
    header = _open(path, header_only=True)[0]
    crop = _crop(path, header)
    header, channels = _open(path, header_only=False)
    attributes = {name: value for name, value in header.items() if name != "channels"}
    widened = {
        name: np.ascontiguousarray(channel.pixels[crop], np.float32)
        for name, channel in channels.items()
    }
    return ExrFile(widened, attributes)


def write_exr(
    path: Path,
    channels: Mapping[str, NDArray[np.floating]],
    attributes: Mapping[str, Any],
    *,
    force: bool = True,
) -> None:
    """Write channels, (H, W) each, as float32 with ZIP compression.

    Attributes may be strings, ints, floats, and tuples of 2, 3 or, for `chromaticities`, 8 floats.
    """
    shapes = {values.shape for values in channels.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2:
        raise ValueError(f"channels must be (H, W) and of one shape, got {shapes}")
    header = {
        **attributes,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
    }
    # The binding ignores strides, and replaces the values of the dictionary it is given.
    pixels = {name: np.ascontiguousarray(values, np.float32) for name, values in channels.items()}
    with replacing(path, force=force) as partial, OpenEXR.File(header, pixels) as file:
        try:
            file.write(str(partial))
        except RuntimeError as error:  # of the C++ core: the disk is full
            raise OSError(str(error).replace(str(partial), path.name)) from None


def _open(path: Path, *, header_only: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    try:
        # Separate channels: the path that joins them to RGB had several memory faults.
        with OpenEXR.File(str(path), separate_channels=True, header_only=header_only) as file:
            if not file.parts:
                raise ValueError("its pixels cannot be decoded")
            return dict(file.header()), dict(file.channels())  # closing the file empties its own
    except Exception as error:  # the binding raises whatever its C++ core met, MemoryError included
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise UnreadableFrame(f"{path}: damaged OpenEXR file ({reason})") from None


def _crop(path: Path, header: dict[str, Any]) -> tuple[slice, slice]:
    """Return the display window as rows and columns of the data window, if it can be read."""
    (data_x0, data_y0), (data_x1, data_y1) = (_corner(c) for c in header["dataWindow"])
    (x0, y0), (x1, y1) = (_corner(c) for c in header["displayWindow"])
    width, height = data_x1 - data_x0 + 1, data_y1 - data_y0 + 1
    check_size(path, width, height)
    if width * height * len(header["channels"]) > 8 * MAX_PIXELS:
        raise UnreadableFrame(f"{path}: {len(header['channels'])} channels of {width}×{height} px")
    for channel in header["channels"]:
        if (channel.xSampling, channel.ySampling) != (1, 1):
            raise InputError(
                f"{path}: channel {channel.name!r} is subsampled; save it at full resolution"
            )
    if not (data_x0 <= x0 <= x1 <= data_x1 and data_y0 <= y0 <= y1 <= data_y1):
        raise InputError(
            f"{path}: holds {width}×{height} px, which do not cover its picture of "
            f"{x1 - x0 + 1}×{y1 - y0 + 1}; save it uncropped (data window = display window)"
        )
    return slice(y0 - data_y0, y1 - data_y0 + 1), slice(x0 - data_x0, x1 - data_x0 + 1)


def _corner(corner: NDArray[np.int32]) -> tuple[int, int]:
    return int(corner[0]), int(corner[1])


# ---- the file's layout (openexr.com, "OpenEXR File Layout") ----

_MAGIC = b"\x76\x2f\x31\x01"
_TILED, _DEEP, _MULTI_PART = 0x200, 0x800, 0x1000


def _check_layout(path: Path, data: bytes) -> None:
    """Refuse kinds that are not read, and files that end before their last chunk of pixels.

    The library would notice a truncation too, after printing a line per missing chunk.
    """
    if not data.startswith(_MAGIC):
        raise UnreadableFrame(f"{path}: not an OpenEXR file")
    try:
        (flags,) = struct.unpack_from("<I", data, 4)
        if flags & (_DEEP | _MULTI_PART):
            kind = "deep pixels" if flags & _DEEP else "several parts"
            raise InputError(f"{path}: an OpenEXR file with {kind}; save one flat picture")
        complete = _is_complete(data, tiled=bool(flags & _TILED))
    except (struct.error, IndexError):
        complete = False
    if not complete:
        raise UnreadableFrame(f"{path}: truncated OpenEXR file")


def _is_complete(data: bytes, *, tiled: bool) -> bool:
    """Tell whether the chunk that lies last in the file is all there."""
    entry = _after_header(data)
    first, last = len(data), 0
    while entry < first:  # the table of offsets ends where the first chunk begins
        (offset,) = struct.unpack_from("<Q", data, entry)
        if not entry < offset < len(data):
            return False
        first, last = min(first, offset), max(last, offset)
        entry += 8
    if last == 0:
        return False
    coordinates = 16 if tiled else 4
    (size,) = struct.unpack_from("<I", data, last + coordinates)
    return last + coordinates + 4 + int(size) <= len(data)


def _after_header(data: bytes) -> int:
    """Return the offset of the byte after the header: attributes of name, type, size and value."""
    position = 8
    while data[position]:
        for _ in range(2):
            end = data.find(b"\0", position)
            if end < 0:
                raise IndexError
            position = end + 1
        (size,) = struct.unpack_from("<I", data, position)
        position += 4 + int(size)
    return position + 1
