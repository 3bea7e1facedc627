"""OpenEXR files decoded by the library, in the process of capture.decoding_worker.

Input  : a file that capture.exr found to be laid out like one.
Output : its attributes as plain values, and the channels of its display window as float32.
"""

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from capture.errors import InputError, UnreadableFrame
from capture.files import MAX_PIXELS, check_size

_MAX_NUMBERS = 64


def decode(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[np.float32]]]:
    """Return the attributes and channels of an OpenEXR file; raises as capture.exr.read_exr does.

    The header is read, and found to be of a picture that is read, before memory is taken for it.
    """
    header = _open(path, header_only=True)[0]
    crop = _crop(path, header)
    header, channels = _open(path, header_only=False)
    attributes = {
        name: plain
        for name, value in header.items()
        if name != "channels" and (plain := _plain(value)) is not None
    }
    widened = {
        name: np.ascontiguousarray(channel.pixels[crop], np.float32)
        for name, channel in channels.items()
    }
    return attributes, widened


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
    tiles = header.get("tiles")  # the library takes memory for a whole one
    if tiles is not None and tiles.xSize * tiles.ySize > MAX_PIXELS:
        raise UnreadableFrame(
            f"{path}: damaged OpenEXR file (tiles of {tiles.xSize}×{tiles.ySize} px)"
        )
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


def _plain(value: Any) -> Any:
    """Return text, a number or a list of numbers; None for an attribute that is none of these."""
    if isinstance(value, (str, int, float)):
        return value
    try:
        if type(value).__module__ == "OpenEXR":  # a name of a list, such as envmap's
            return str(value)
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):  # damaged, or of another kind
        return None
    return numbers.ravel().tolist() if numbers.size <= _MAX_NUMBERS else None
