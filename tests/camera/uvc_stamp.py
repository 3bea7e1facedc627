"""The truth in every frame: its number, exposure and gain, written where no scene is.

Uncompressed frames carry 40 bits in their last rows, black or white cells of 4 pixels, which
survive a conversion of colours and demosaicing. A JPEG carries a comment segment, which survives as
long as the file's bytes do.
"""

import re
from collections.abc import Iterable
from itertools import accumulate
from typing import Any, NamedTuple

STAMP_ROWS = 8
_CELL_PX = 4
_BITS = (16, 16, 8)
_MARK = b"stamp %d %d %d"
_PATTERN = re.compile(rb"stamp (\d+) (\d+) (\d+)")

_CELLS = {
    "YUYV": (b"\x10\x80" * _CELL_PX, b"\xeb\x80" * _CELL_PX),
    "GREY": (b"\x00" * _CELL_PX, b"\xff" * _CELL_PX),
    "RG16": (b"\x00\x00" * _CELL_PX, b"\xf0\xff" * _CELL_PX),
}
"""A black and a white cell's row of bytes."""


class Stamp(NamedTuple):
    """Frame number modulo 65536, exposure in units of 100 µs, gain."""

    frame: int
    exposure: int
    gain: int


def stamped(picture: bytearray, pixel_format: str, width_px: int, stamp: Stamp) -> bytes:
    """Return the picture with its stamp; an uncompressed one is at least 160 pixels wide."""
    if pixel_format == "MJPG":
        comment = _MARK % stamp
        segment = b"\xff\xfe" + (len(comment) + 2).to_bytes(2, "big") + comment
        return bytes(picture[:2] + segment + picture[2:])  # after the start-of-image marker
    bits = "".join(f"{value:0{width}b}" for value, width in zip(stamp, _BITS, strict=True))
    cells = b"".join(_CELLS[pixel_format][bit == "1"] for bit in bits)
    row_bytes = len(cells) // (len(bits) * _CELL_PX) * width_px
    for row in range(1, STAMP_ROWS + 1):
        start = len(picture) - row * row_bytes
        picture[start : start + len(cells)] = cells
    return bytes(picture)


def stamp_of_data(data: bytes, pixel_format: str, width_px: int) -> Stamp:
    """Return the stamp of a frame as the camera sent it."""
    if pixel_format == "MJPG":
        found = _PATTERN.search(data)
        if found is None:
            raise ValueError("no stamp in the JPEG")
        return Stamp(*map(int, found.groups()))
    black, white = _CELLS[pixel_format]
    pixel_bytes = len(black) // _CELL_PX
    telling = next(place for place in range(pixel_bytes) if white[place] - black[place] > 128)
    row = data[len(data) - pixel_bytes * width_px :]
    return _of_bits([byte > 128 for byte in row[telling :: len(black)]])


def stamp_of_counts(counts: Any) -> Stamp:
    """Return the stamp of a decoded frame, (H, W, 3) uint8 or uint16."""
    half = 1.5 * (255 if counts.itemsize == 1 else 65535)
    centres = counts[-STAMP_ROWS // 2, _CELL_PX // 2 :: _CELL_PX].sum(axis=-1, dtype=int)
    return _of_bits(centres > half)


def _of_bits(bits: Iterable[Any]) -> Stamp:
    text = "".join("1" if bit else "0" for bit in bits)
    ends = list(accumulate(_BITS))
    starts = [0, *ends[:-1]]
    return Stamp(*(int(text[start:end], 2) for start, end in zip(starts, ends, strict=True)))
