"""The headers of JPEG, PNG and TIFF files: what the picture is, and whether the file is whole.

Input  : a file's bytes.    Output : PictureHeader, without decoding a pixel.
Cost   : one pass over the markers or chunks, far below a millisecond for a camera's JPEG.
Fails  : damage inside the compressed data is not seen here. A PNG's checksums reveal it when it is
         decoded; in a JPEG or TIFF only a digest kept beside the file does.

Decoders differ in what they do with half a file (some fill the rest with grey) and in how much
they allocate for a forged size, so both are settled here, before any decoder sees the bytes.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

JPEG_START = b"\xff\xd8\xff"
PNG_START = b"\x89PNG\r\n\x1a\n"
TIFF_STARTS = (b"II*\0", b"MM\0*")

_MAX_PARTS = 2**20
"""Markers, chunks or strips that are looked at: more than any picture has, within half a second."""
_TOO_MANY_PARTS = f"damaged: more than {_MAX_PARTS} parts"
_MAX_SCANS = 100
"""Scans of a JPEG. Encoders write about ten; each costs the decoder a pass over the picture."""


@dataclass(frozen=True)
class PictureHeader:
    """What a picture file says about itself.

    `channels` counts colours only: 1 (grey) or 3; `has_alpha` tells whether transparency follows.
    """

    format: str
    width_px: int
    height_px: int
    channels: int
    bits: int
    has_alpha: bool


def parse_header(data: bytes) -> PictureHeader:
    """Return the header of a complete JPEG, PNG or TIFF file.

    Raises
    ------
    ValueError
        With the reason, if the bytes are none of these, break off early or hold a kind of picture
        that is not a camera's (floats, palettes in TIFF, CMYK).
    """
    try:
        if data.startswith(JPEG_START):
            header = _parse_jpeg(data)
        elif data.startswith(PNG_START):
            header = _parse_png(data)
        elif data.startswith(TIFF_STARTS):
            header = _parse_tiff(data)
        else:
            raise ValueError("not a JPEG, PNG or TIFF file")
    except (struct.error, IndexError):
        raise ValueError("truncated: the file ends inside its header") from None
    if header.width_px < 1 or header.height_px < 1:
        raise ValueError(f"the header says {header.width_px}×{header.height_px} px")
    return header


# ---- JPEG (ITU-T T.81, annex B) ----

_START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN, _END_OF_IMAGE = 0xDA, 0xD9
_STANDALONE = frozenset((0x01, *range(0xD0, 0xD9)))
# Inside a scan FF is followed by 00 (a data byte FF), a restart marker or fill bytes.
_MARKER_AFTER_SCAN = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]", re.DOTALL)


def _parse_jpeg(data: bytes) -> PictureHeader:
    header = None
    for marker, start in _jpeg_segments(data):
        if marker in _START_OF_FRAME and header is None:
            bits, height, width, components = struct.unpack_from(">BHHB", data, start + 2)
            if bits != 8 or components not in (1, 3):
                raise ValueError(
                    f"a JPEG of {components} components of {bits} bits; wanted 1 or 3 of 8 bits"
                )
            header = PictureHeader("JPEG", width, height, components, bits, has_alpha=False)
    if header is None:
        raise ValueError("a JPEG without a picture in it")
    return header


def _jpeg_segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield (marker, offset of the segment) up to the end of the picture.

    Bytes after the end are legal: cameras put previews and depth maps there.
    """
    position = 2
    scans = 0
    for _ in range(_MAX_PARTS):
        if data[position] != 0xFF:
            raise ValueError("damaged: a JPEG marker is missing")
        marker = data[position + 1]
        if marker == 0xFF:  # fill byte
            position += 1
            continue
        position += 2
        if marker == _END_OF_IMAGE:
            return
        if marker in _STANDALONE:
            continue
        yield marker, position
        position += int(struct.unpack_from(">H", data, position)[0])
        if marker == _START_OF_SCAN:
            scans += 1
            if scans > _MAX_SCANS:
                raise ValueError(f"a JPEG of more than {_MAX_SCANS} scans")
            end = _MARKER_AFTER_SCAN.search(data, position)
            if end is None:
                raise ValueError("truncated: the JPEG breaks off before its end marker")
            position = end.start()
    raise ValueError(_TOO_MANY_PARTS)


# ---- PNG (ISO/IEC 15948) ----

_PNG_CHANNELS = {0: (1, False), 2: (3, False), 3: (3, False), 4: (1, True), 6: (3, True)}


def _parse_png(data: bytes) -> PictureHeader:
    header = None
    position = len(PNG_START)
    transparent = False
    for _ in range(_MAX_PARTS):
        length, kind = struct.unpack_from(">I4s", data, position)
        body = position + 8
        position = body + length + 4
        if position > len(data):
            raise ValueError("truncated: the PNG breaks off before its end chunk")
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack_from(">IIBB", data, body)
            if colour not in _PNG_CHANNELS:
                raise ValueError(f"damaged: PNG colour type {colour} does not exist")
            channels, has_alpha = _PNG_CHANNELS[colour]
            header = (width, height, channels, max(bits, 8), has_alpha)
        transparent |= kind == b"tRNS"
        if kind == b"IEND":
            break
    else:
        raise ValueError(_TOO_MANY_PARTS)
    if header is None:
        raise ValueError("a PNG without a header chunk")
    width, height, channels, bits, has_alpha = header
    return PictureHeader("PNG", width, height, channels, bits, has_alpha or transparent)


# ---- TIFF 6.0 ----

_WIDTH, _HEIGHT, _BITS, _PHOTOMETRIC, _SAMPLES = 256, 257, 258, 262, 277
_ORIENTATION, _SAMPLE_FORMAT = 274, 339
_STRIP_OFFSETS, _STRIP_BYTES, _TILE_OFFSETS, _TILE_BYTES = 273, 279, 324, 325
_BLACK_IS_ZERO, _RGB = 1, 2
_STORAGE = (_STRIP_OFFSETS, _STRIP_BYTES, _TILE_OFFSETS, _TILE_BYTES)
_USED_TAGS = frozenset(
    (_WIDTH, _HEIGHT, _BITS, _PHOTOMETRIC, _SAMPLES, _ORIENTATION, _SAMPLE_FORMAT, *_STORAGE)
)
_TIFF_INTEGERS = {1: "B", 3: "H", 4: "I"}


def _parse_tiff(data: bytes) -> PictureHeader:
    tags = _tiff_tags(data)
    if _WIDTH not in tags or _HEIGHT not in tags:
        raise ValueError("damaged: the TIFF does not tell its size")
    (photometric,) = tags.get(_PHOTOMETRIC, (-1,))[:1]
    (samples,) = tags.get(_SAMPLES, (1,))[:1]
    bits = set(tags.get(_BITS, (1,)))
    colours = {_BLACK_IS_ZERO: 1, _RGB: 3}.get(photometric, 0)
    if (colours, samples) not in ((1, 1), (3, 3), (3, 4)):
        raise ValueError(
            f"a TIFF of {samples} samples, photometric type {photometric}; wanted grey, RGB or RGBA"
        )
    if bits not in ({8}, {16}) or set(tags.get(_SAMPLE_FORMAT, (1,))) != {1}:
        raise ValueError(f"a TIFF of {sorted(bits)} bits; wanted 8- or 16-bit unsigned integers")
    if tags.get(_ORIENTATION, (1,))[0] != 1:
        # The decoder would turn the pixels, and a calibration holds for them as they are stored.
        raise ValueError("a TIFF with an orientation tag; save it upright, without the tag")
    for offsets, counts in ((_STRIP_OFFSETS, _STRIP_BYTES), (_TILE_OFFSETS, _TILE_BYTES)):
        ends = map(sum, zip(tags.get(offsets, ()), tags.get(counts, ()), strict=False))
        if max(ends, default=0) > len(data):
            raise ValueError("truncated: the TIFF's pixels lie beyond the end of the file")
    (width,), (height,) = tags[_WIDTH][:1], tags[_HEIGHT][:1]
    return PictureHeader("TIFF", width, height, colours, bits.pop(), samples > colours)


def _tiff_tags(data: bytes) -> dict[int, tuple[int, ...]]:
    """Return the integer tags of the first directory that are used here; of twins the first."""
    order = "<" if data.startswith(b"II") else ">"
    (directory,) = struct.unpack_from(order + "I", data, 4)
    (count,) = struct.unpack_from(order + "H", data, directory)
    tags: dict[int, tuple[int, ...]] = {}
    for entry in range(directory + 2, directory + 2 + 12 * count, 12):
        tag, kind, length = struct.unpack_from(order + "HHI", data, entry)
        code = _TIFF_INTEGERS.get(kind)
        if code is None or length == 0 or tag not in _USED_TAGS or tag in tags:
            continue
        if length > _MAX_PARTS:
            raise ValueError(_TOO_MANY_PARTS)
        size = struct.calcsize(order + code) * length
        if size > len(data):
            raise ValueError("damaged: a TIFF tag is larger than the file")
        place = entry + 8 if size <= 4 else struct.unpack_from(order + "I", data, entry + 8)[0]
        tags[tag] = struct.unpack_from(f"{order}{length}{code}", data, place)
    return tags
