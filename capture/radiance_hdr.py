"""Radiance .hdr pictures: RGBE or XYZE pixels behind a text header.

Input  : files of Radiance and of the programs that imitate it, in all orientations and encodings.
Output : linear RGB with the header's EXPOSURE and COLORCORR divided out; written upright.
Cost   : 75 ms for 2048 × 1024, once the decoder is compiled.
Fails  : eight bits of mantissa, shared exponent: a channel below 1/256 of the largest is lost.
         Mantissas are taken as they are, as most programs do; Radiance itself truncates when it
         writes and adds half a step when it reads, so its pictures come out 0.3 % darker here.

The format is described in "Radiance File Formats" by Greg Ward, section "Picture File Format".
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from capture.errors import InputError, UnreadableFrame
from capture.files import check_size, read_bytes
from capture.output import replacing
from capture.primaries import PRIMARIES, REC709, PrimariesName, rgb_to_xyz

_MAGIC = (b"#?RADIANCE", b"#?RGBE")
_MAX_HEADER_BYTES = 2**16
_BLANK_LINE = re.compile(rb"\r?\n\r?\n")
_MIN_RUN_WIDTH, _MAX_RUN_WIDTH = 8, 32767
"""Scan lines outside are never run-length encoded by channel."""
_RESOLUTION = re.compile(rb"([+-])([XY])\s+(\d{1,9})\s+([+-])([XY])\s+(\d{1,9})\s*")
_STEP = np.ldexp(1.0, np.arange(256) - 136).astype(np.float32)  # value of one mantissa step
_STEP[0] = 0.0  # exponent 0 is black


@dataclass(frozen=True)
class _Layout:
    """Where the pixels begin and how scan lines lie in the picture."""

    header: dict[str, str]
    start: int
    scanline_axis: str  # "Y" if a scan line is a row, "X" if it is a column
    scanlines: int
    length: int
    flip_rows: bool
    flip_columns: bool


def read_radiance_hdr(path: Path) -> tuple[NDArray[np.float32], dict[str, str]]:
    """Return the picture upright, (H, W, 3) linear RGB, and its header's variables.

    Radiance is the stored value over the product of all EXPOSURE lines, and by channel over that
    of all COLORCORR lines; both are done here. RGB keeps the file's primaries (PRIMARIES in the
    header, if given); XYZ is converted to Rec.709. Of a variable that is given several times the
    header holds the last.

    Raises
    ------
    UnreadableFrame
        If the file is truncated, damaged or not a Radiance picture.
    InputError
        If it does not exist.
    """
    data = read_bytes(path)
    try:
        layout, divisor = _parse_header(data)
    except ValueError as error:
        raise UnreadableFrame(f"{path}: {error}") from None
    check_size(path, layout.length, layout.scanlines)
    rgbe = _decode(path, data, layout)
    if layout.scanline_axis == "X":
        rgbe = rgbe.swapaxes(0, 1)
    rgbe = rgbe[:: -1 if layout.flip_rows else 1, :: -1 if layout.flip_columns else 1]
    picture = rgbe[..., :3] * _STEP[rgbe[..., 3]][..., None]
    with np.errstate(over="ignore"):  # an infinite value is counted where radiance is cleaned
        if np.any(divisor != 1.0):
            picture /= divisor.astype(np.float32)
        if layout.header["FORMAT"].endswith("xyze"):
            picture = picture @ np.linalg.inv(rgb_to_xyz(REC709)).T.astype(np.float32)
    return np.ascontiguousarray(picture), layout.header


def write_radiance_hdr(
    path: Path,
    rgb: NDArray[np.floating],
    primaries: PrimariesName = "rec709",
    *,
    force: bool = True,
) -> None:
    """Write linear RGB, (H, W, 3), finite and not negative; mantissas are rounded.

    Raises
    ------
    InputError
        If a value is negative, not finite, or above 2^126, which the format cannot hold.
    """
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise ValueError(f"a picture must be (H, W, 3), got {rgb.shape}")
    least, most = rgb.min(initial=0), rgb.max(initial=0)
    if not (least >= 0 and most <= 2.0**126):
        raise InputError(
            f"{path}: a .hdr file holds finite numbers from 0 to 2^126, not {least:g} to {most:g}; "
            "write an .exr file"
        )
    height, width = rgb.shape[:2]
    chromaticities = " ".join(f"{value:g}" for value in PRIMARIES[primaries].ravel())
    lines = ("#?RADIANCE", f"PRIMARIES={chromaticities}", "FORMAT=32-bit_rle_rgbe", "")
    header = "\n".join((*lines, f"-Y {height} +X {width}\n"))
    with replacing(path, force=force) as partial:
        # Plain pixels are legal and unambiguous: a run starts with bytes 2 2 or 1 1 1, while the
        # largest mantissa of a pixel is at least 128.
        partial.write_bytes(header.encode() + _encode(rgb).tobytes())


def _encode(rgb: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return (H, W, 4) mantissas and exponents."""
    largest = rgb.max(axis=-1).astype(np.float64)
    exponent = np.frexp(largest)[1]
    # 255.5 and more would round to 256.
    exponent += np.rint(np.ldexp(largest, 8 - exponent)) == 256
    mantissa = np.rint(np.ldexp(rgb.astype(np.float64), (8 - exponent)[..., None]))
    rgbe = np.concatenate([mantissa, exponent[..., None] + 128.0], axis=-1)
    rgbe[(largest == 0) | (exponent < -127)] = 0
    return rgbe.astype(np.uint8)


def _parse_header(data: bytes) -> tuple[_Layout, NDArray[np.float64]]:
    """Return the layout, and what stored RGB is to be divided by, (3,)."""
    end = _BLANK_LINE.search(data, 0, _MAX_HEADER_BYTES)
    lines = data[: end.start()].splitlines() if end else []
    # Programs that copy headers about have put lines before the first one.
    if end is None or not any(line.startswith(_MAGIC) for line in lines):
        raise ValueError("not a Radiance picture (no #?RADIANCE line in a header)")
    header: dict[str, str] = {}
    divisor = np.ones(3)
    for line in lines:
        name, separator, value = line.decode("latin-1").partition("=")
        if not separator or line.startswith(b"#"):
            continue
        header[name.strip()] = value.strip()
        if name.strip() in ("EXPOSURE", "COLORCORR"):
            divisor *= _factors(name.strip(), value)
            if not all(map(_is_usable, divisor)):
                raise ValueError(f"all EXPOSURE and COLORCORR together come to {divisor.tolist()}")
    encoding = header.setdefault("FORMAT", "32-bit_rle_rgbe")
    if encoding not in ("32-bit_rle_rgbe", "32-bit_rle_xyze"):
        raise ValueError(f"FORMAT {encoding!r} is not known; wanted 32-bit_rle_rgbe or _xyze")
    return _parse_resolution(data, end.end(), header), divisor


def _parse_resolution(data: bytes, start: int, header: dict[str, str]) -> _Layout:
    line_end = data.find(b"\n", start, start + 100)
    match = _RESOLUTION.fullmatch(data, start, max(line_end, start))
    if match is None or match[2] == match[5]:
        raise ValueError("truncated or damaged: no line like '-Y 512 +X 1024' follows the header")
    first_sign, axis, scanlines, second_sign, _, length = match.groups()
    signs = {axis: first_sign, match[5]: second_sign}
    layout = _Layout(
        header=header,
        start=line_end + 1,
        scanline_axis=axis.decode(),
        scanlines=int(scanlines),
        length=int(length),
        flip_rows=signs[b"Y"] == b"+",  # Y counts upward
        flip_columns=signs[b"X"] == b"-",
    )
    if layout.scanlines == 0 or layout.length == 0:
        raise ValueError(f"the header says {layout.length}×{layout.scanlines} px")
    return layout


def _factors(name: str, value: str) -> NDArray[np.float64]:
    words = value.split()
    try:
        factors = [float(word) for word in words]
    except ValueError:
        factors = []
    if not all(map(_is_usable, factors)) or len(factors) != (1 if name == "EXPOSURE" else 3):
        raise ValueError(f"{name} {value!r} is not usable; correct or remove that line")
    return np.array(factors)


def _is_usable(divisor: float) -> bool:
    return 1e-30 < divisor < 1e30  # stays within float32, as the pixels are


def _decode(path: Path, data: bytes, layout: _Layout) -> NDArray[np.uint8]:
    """Return mantissas and exponents as they are stored, (scanlines, length, 4)."""
    if layout.scanlines > len(data):  # a forged size ends here, before memory is taken for it
        raise UnreadableFrame(f"{path}: truncated: fewer bytes than scan lines")
    rgbe = np.empty((layout.scanlines, layout.length, 4), np.uint8)
    done = decode_scanlines(np.frombuffer(data, np.uint8), layout.start, rgbe)
    if done < layout.scanlines:
        converted = b"\r\n" in data[: layout.start]
        raise UnreadableFrame(
            f"{path}: truncated or damaged: {done} of {layout.scanlines} scan lines can be decoded"
            + ("; its line ends were converted like a text's, fetch it again" if converted else "")
        )
    return rgbe


@njit(cache=True, nogil=True)
def decode_scanlines(data: NDArray[np.uint8], start: int, rgbe: NDArray[np.uint8]) -> int:
    """Fill `rgbe`, (scanlines, length, 4), from `data`; return how many scan lines were whole.

    Three encodings may follow one another line by line: runs by channel (a line that begins with
    2, 2 and its length), and plain pixels, among which 1, 1, 1, n repeats the last one n times.
    """
    scanlines, length = rgbe.shape[:2]
    position = start
    for line in range(scanlines):
        by_channel = (
            _MIN_RUN_WIDTH <= length <= _MAX_RUN_WIDTH
            and position + 4 <= data.size
            and data[position] == 2
            and data[position + 1] == 2
            and data[position + 2] < 128
        )
        if by_channel:
            if (data[position + 2] << 8) + data[position + 3] != length:
                return line
            position = _decode_channels(data, position + 4, rgbe[line])
        else:
            position = _decode_pixels(data, position, rgbe[line])
        if position < 0:
            return line
    return scanlines


@njit(cache=True, nogil=True)
def _decode_channels(data: NDArray[np.uint8], position: int, line: NDArray[np.uint8]) -> int:
    """Fill one scan line; return the position after it, or -1."""
    length = line.shape[0]
    for channel in range(4):
        column = 0
        while column < length:
            if position + 2 > data.size:
                return -1
            code = int(data[position])
            count = code - 128 if code > 128 else code
            if column + count > length:
                return -1
            if code > 128:
                line[column : column + count, channel] = data[position + 1]
                position += 2
            else:
                if position + 1 + count > data.size:
                    return -1
                line[column : column + count, channel] = data[position + 1 : position + 1 + count]
                position += 1 + count
            column += count
    return position


@njit(cache=True, nogil=True)
def _decode_pixels(data: NDArray[np.uint8], position: int, line: NDArray[np.uint8]) -> int:
    """Fill one scan line; return the position after it, or -1."""
    length = line.shape[0]
    column, shift = 0, 0
    while column < length:
        if position + 4 > data.size:
            return -1
        pixel = data[position : position + 4]
        position += 4
        if pixel[0] == 1 and pixel[1] == 1 and pixel[2] == 1:
            # Repeats in a row are digits of one number, the lowest first.
            count = int(pixel[3]) << shift
            if column == 0 or shift > 24 or column + count > length:
                return -1
            for _ in range(count):
                line[column] = line[column - 1]
                column += 1
            shift += 8
        else:
            line[column] = pixel
            column += 1
            shift = 0
    return position
