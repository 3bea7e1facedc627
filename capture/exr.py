"""OpenEXR files: named channels of float32 pixels, and attributes.

Input  : a single-part file, scan lines or tiles, of any compression.
Output : a dictionary of channels; written as float32 scan lines with ZIP compression, which is
         exact. (Half floats end at 65504, below an unclipped sun.)
Fails  : a byte changed inside compressed pixels often still decodes; only a digest tells.
"""

import mmap
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from capture.decoding import decode
from capture.errors import InputError, UnreadableFrame
from capture.files import check_file
from capture.output import replacing


@dataclass(frozen=True)
class ExrFile:
    """An OpenEXR picture.

    Attributes
    ----------
    channels : dict of str to (H, W) float32
        The pixels of the display window; half and integer channels are widened.
    attributes : dict
        The header's text, numbers, and lists of numbers.
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
    check_file(path)
    # Mapped, not read: of a large file that is none, no more than the header is looked at.
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        _check_layout(path, data)
    attributes, channels = decode("exr", path)
    return ExrFile(channels, attributes)


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


# ---- the file's layout (openexr.com, "OpenEXR File Layout") ----

_MAGIC = b"\x76\x2f\x31\x01"
_MAX_CHUNKS = 2**20
_TILED, _DEEP, _MULTI_PART = 0x200, 0x800, 0x1000


def _check_layout(path: Path, data: mmap.mmap) -> None:
    """Refuse kinds that are not read, and files that end before their last chunk of pixels.

    The library would notice a truncation too, after printing a line per missing chunk.
    """
    if data[:4] != _MAGIC:
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


def _is_complete(data: mmap.mmap, *, tiled: bool) -> bool:
    """Tell whether the chunk that lies last in the file is all there."""
    table = _after_header(data)
    (end,) = struct.unpack_from("<Q", data, table)  # the first chunk's; others may lie before it
    count = min((min(end, len(data)) - table) // 8, _MAX_CHUNKS)
    if count < 1:
        return False
    offsets = np.array(struct.unpack_from(f"<{count}Q", data, table), np.uint64)
    places = table + 8 * np.arange(count, dtype=np.uint64)
    # The table ends where the chunk begins that lies first in the file.
    beyond = np.flatnonzero(places[1:] >= np.minimum.accumulate(offsets)[:-1])
    if beyond.size:
        offsets, places = offsets[: beyond[0] + 1], places[: beyond[0] + 1]
    if not np.all((places < offsets) & (offsets < len(data))):
        return False
    last = int(offsets.max())
    coordinates = 16 if tiled else 4
    (size,) = struct.unpack_from("<I", data, last + coordinates)
    return last + coordinates + 4 + int(size) <= len(data)


def _after_header(data: mmap.mmap) -> int:
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
