"""What a camera wrote about a picture: exposure, moment and camera.

Input  : a JPEG, TIFF, PNG or RAW file.    Output : Exif, with None for what it does not tell.
Fails  : cameras round exposure times to the engraved series (1/30 s is 1/32 s), an error of up to
         7 % in radiance, and their clocks run free.
"""

import io
import logging
import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import exifread

from capture.files import check_file

# exifread reports damaged and absent tags through logging; here both are None.
logging.getLogger("exifread").addHandler(logging.NullHandler())

_MAX_READS, _MAX_READ_BYTES = 100_000, 2**24
"""A hundred times what the largest camera's directories take."""


@dataclass(frozen=True)
class Exif:
    """A picture's metadata.

    Attributes
    ----------
    time_s, f_number : float or None
        Exposure time and aperture; None if absent, zero or not a number.
    gain : float or None
        ISO speed over 100.
    timestamp_s : float or None
        Moment of exposure since 1970-01-01, with the fraction of a second where the camera tells
        it. Without a time zone in the file, the camera's clock is read as if it were UTC:
        differences hold within one camera, the absolute time does not.
    utc_offset : timedelta or None
        What the camera's clock was ahead of universal time; None if the file does not tell.
    equivalent_focal_length_mm : float or None
        Focal length of a lens that sees as much on 35 mm film, whose picture is 36 × 24 mm.
    camera : str
        Maker and model, "" if absent.
    orientation : int
        How to turn the stored pixels for viewing, 1 to 8; 1 is upright.
    """

    time_s: float | None = None
    gain: float | None = None
    f_number: float | None = None
    timestamp_s: float | None = None
    utc_offset: timedelta | None = None
    equivalent_focal_length_mm: float | None = None
    camera: str = ""
    orientation: int = 1


def read_exif(path: Path) -> Exif:
    """Return a picture's metadata; a picture without any, or with damaged ones, gives None fields.

    Raises
    ------
    InputError
        If the file cannot be read at all.
    """
    check_file(path)
    tags = read_tags(path)
    iso = _positive(tags, "ISOSpeedRatings")
    orientation = _positive(tags, "Orientation") or 1
    timestamp_s, utc_offset = _moment(tags)
    return Exif(
        time_s=_positive(tags, "ExposureTime"),
        gain=None if iso is None else iso / 100,
        f_number=_positive(tags, "FNumber"),
        timestamp_s=timestamp_s,
        utc_offset=utc_offset,
        equivalent_focal_length_mm=_positive(tags, "FocalLengthIn35mmFilm"),
        camera=_camera(tags),
        orientation=int(orientation) if orientation in range(1, 9) else 1,
    )


def read_tags(path: Path) -> dict[str, Any]:
    """Return exifread's tags by their names; none if they are damaged, or take too long."""
    try:
        with _MeteredFile(path) as file:
            return exifread.process_file(file, details=False)
    except Exception:  # the parser trusts offsets in the file, and fails in any way on damaged ones
        return {}


class _MeteredFile(io.FileIO):
    """A file that can be read so often and so much.

    Directories that name one another make a parser that follows them run for ever.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._reads_left, self._bytes_left = _MAX_READS, _MAX_READ_BYTES

    def read(self, size: int | None = -1, /) -> bytes:
        self._reads_left -= 1
        self._bytes_left -= size if size is not None and size >= 0 else _MAX_READ_BYTES
        if self._reads_left < 0 or self._bytes_left < 0:
            raise OSError("too much to read")
        return super().read(size)


def _positive(tags: dict[str, Any], name: str) -> float | None:
    """Return a number of EXIF's directory, or of the picture's own, where TIFF/EP has it."""
    for directory in ("EXIF", "Image"):
        try:
            value = float(tags[f"{directory} {name}"].values[0])
        except (KeyError, IndexError, TypeError, ValueError, ZeroDivisionError, OverflowError):
            continue
        if math.isfinite(value) and value > 0:
            return value
    return None


def _text(tags: dict[str, Any], name: str) -> str:
    values = getattr(tags.get(name), "values", "")
    return "".join(filter(str.isprintable, values)).strip() if isinstance(values, str) else ""


def _camera(tags: dict[str, Any]) -> str:
    maker, model = _text(tags, "Image Make"), _text(tags, "Image Model")
    return model if model.startswith(maker) else f"{maker} {model}".strip()


def _moment(tags: dict[str, Any]) -> tuple[float | None, timedelta | None]:
    """Return the timestamp of a picture and the offset of the clock that it was read off."""
    for suffix, name in (("Original", "EXIF DateTimeOriginal"), ("", "Image DateTime")):
        try:
            moment = datetime.strptime(_text(tags, name), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
        except ValueError:
            continue
        offset = _utc_offset(tags, suffix)
        clock_s = moment.timestamp() + _fraction(tags, suffix)
        return clock_s - (offset or timedelta()).total_seconds(), offset
    return None, None


def _fraction(tags: dict[str, Any], suffix: str) -> float:
    digits = _text(tags, f"EXIF SubSecTime{suffix}")
    return float(f"0.{digits}") if digits.isascii() and digits.isdigit() else 0.0


def _utc_offset(tags: dict[str, Any], suffix: str) -> timedelta | None:
    try:
        return datetime.strptime(_text(tags, f"EXIF OffsetTime{suffix}"), "%z").utcoffset()
    except ValueError:
        return None
