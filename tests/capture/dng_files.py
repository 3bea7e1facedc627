"""DNG files for tests: one uncompressed plane of counts, whose truth is known.

The camera is a made-up one. Its own primaries are Rec.709 unless a test says otherwise, so that
development is the identity but for the levels.
"""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.primaries import REC709, rgb_to_xyz

BLACK, WHITE = 512, 16383
RGGB = (0, 1, 1, 2)

_SIZES = {"B": (1, 1), "s": (2, 1), "H": (3, 2), "I": (4, 4), "R": (5, 8), "r": (10, 8)}
"""TIFF's number and size of each type: bytes, text, 16 and 32 bits, unsigned and signed ratios."""


def colour_matrix(camera_from_rec709: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """XYZ to camera, as the tag ColorMatrix has it, of a camera that sees Rec.709 as given."""
    camera = np.eye(3) if camera_from_rec709 is None else camera_from_rec709
    return camera @ np.linalg.inv(rgb_to_xyz(REC709))


def dng(
    counts: NDArray[Any],
    *,
    bits: int = 16,
    black: Sequence[int] = (BLACK,),
    white: Sequence[int] = (WHITE,),
    matrices: Sequence[tuple[int, NDArray[np.float64]]] | None = None,
    forward: NDArray[np.float64] | None = None,
    as_shot: tuple[int, int, int] = (100, 100, 100),
    orientation: int = 1,
    width: int | None = None,
    monochrome: bool = False,
    time_s: tuple[int, int] | None = None,
) -> bytes:
    """Return a DNG file of counts: (H, W) behind an RGGB mosaic, or (H, W, 3) without one.

    `black` is one level, four of a mosaic's cell, or three of linear colours; `matrices` are up to
    two of (illuminant, ColorMatrix), and `forward` is the last one's ForwardMatrix.
    """
    if matrices is None:
        matrices = [(21, colour_matrix())]
    height, samples = counts.shape[0], 1 if counts.ndim == 2 else 3
    width = width or counts.shape[1]
    mosaic = samples == 1 and not monochrome
    pixels = packed(counts, bits)
    tags: dict[int, tuple[str, Any]] = {
        254: ("I", [0]),  # NewSubFileType: the main picture
        256: ("I", [width]),
        257: ("I", [height]),
        258: ("H", [bits] * samples),
        259: ("H", [1]),  # no compression
        262: ("H", [32803 if mosaic else 34892]),  # a colour filter array, or linear
        271: ("s", b"Test\0"),
        272: ("s", b"Plane\0"),
        273: ("I", [0]),  # StripOffsets, set below
        274: ("H", [orientation]),
        277: ("H", [samples]),
        278: ("I", [height]),
        279: ("I", [len(pixels)]),
        284: ("H", [1]),  # samples side by side
        50706: ("B", [1, 4, 0, 0]),  # DNGVersion
        50708: ("s", b"Test Plane\0"),
        50713: ("H", [2, 2] if len(black) == 4 else [1, 1]),
        50714: ("H", list(black)),
        50717: ("H", list(white)),
    }
    if mosaic:
        tags |= {33421: ("H", [2, 2]), 33422: ("B", list(RGGB))}
    if time_s:
        tags[33434] = ("R", list(time_s))
    if not monochrome:
        tags[50728] = ("R", [number for value in as_shot for number in (value, 100)])
        for place, (illuminant, matrix) in enumerate(matrices):
            tags[50721 + place] = ("r", _ratios(matrix))
            tags[50778 + place] = ("H", [illuminant])
        if forward is not None:
            tags[50964 + len(matrices) - 1] = ("r", _ratios(forward))
    return _tiff(tags, pixels)


def packed(counts: NDArray[Any], bits: int) -> bytes:
    """Return rows of `bits` a count, the highest first, each row ending with a byte."""
    if bits == 16:
        return counts.astype("<u2").tobytes()
    rows = counts.reshape(counts.shape[0], -1).astype(">u2")
    digits = np.unpackbits(rows.view(np.uint8), axis=1).reshape(*rows.shape, 16)[..., 16 - bits :]
    return np.packbits(digits.reshape(len(rows), -1), axis=1).tobytes()


def _ratios(matrix: NDArray[np.float64]) -> list[int]:
    whole = np.rint(matrix * 100_000).astype(int).ravel()
    return [number for value in whole for number in (int(value), 100_000)]


def _tiff(tags: dict[int, tuple[str, Any]], pixels: bytes) -> bytes:
    values_at = 8 + 2 + 12 * len(tags) + 4
    pixels_at = values_at + 1024
    entries, values = b"", b""
    for tag, (kind, value) in sorted(tags.items()):
        code, size = _SIZES[kind]
        letter = {"R": "I", "r": "i"}.get(kind, kind)
        if tag == 273:
            value = [pixels_at]
        data = value if kind == "s" else struct.pack(f"<{len(value)}{letter}", *value)
        place = data.ljust(4, b"\0")
        if len(data) > 4:
            place = struct.pack("<I", values_at + len(values))
            values += data + b"\0" * (len(data) % 2)
        entries += struct.pack("<HHI", tag, code, len(data) // size) + place
    header = struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + entries + bytes(4)
    return (header + values).ljust(pixels_at, b"\0") + pixels
