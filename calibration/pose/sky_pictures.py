"""Pictures of the sky and the moments they were taken at, in universal time.

Input  : a recording, or picture files with EXIF.    Output : SkyPicture, still to be decoded.
Domain : a moment is only used if it is known in universal time. A camera's clock without a zone is
not: the zone has to be told. Nor is a live camera's clock, which counts from when its machine
started, or a video's: the moment of the first picture has to be told.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.camera_files import read_camera_file
from capture.errors import InputError
from capture.exif import read_exif
from capture.manifest import FrameRecord
from capture.recording import Recording, contained_file, open_recording
from capture.sensor import Sensor

_MOST_PICTURES = 500
"""Spread evenly over what was recorded; more tell hardly more."""

_FIRST_DATE_S = 1e9
"""September 2001: timestamps below it count from a start, not from 1970."""


Counts = tuple[NDArray[Any], Sensor]


@dataclass(frozen=True)
class SkyPicture:
    """A picture of the sky.

    Attributes
    ----------
    name : str
        Of its file.
    timestamp_s : float
        Since 1970-01-01 UTC.
    read : function
        Returns counts (H, W, 3) and the sensor that explains them; UnreadableFrame if it cannot.
    """

    name: str
    timestamp_s: float
    read: Callable[[], Counts]


def parse_utc_offset(text: str) -> timedelta:
    """Return the offset from universal time of "Z", "UTC", "+02:00" or "-0730".

    Raises
    ------
    InputError
        For anything else, names of zones among it: camera clocks do not keep summer time by them.
    """
    try:
        offset = datetime.strptime("Z" if text.upper() == "UTC" else text, "%z").utcoffset()
    except ValueError:
        offset = None
    if offset is None:
        raise InputError(
            f"--time-zone is what the camera's clock is ahead of universal time, such as +02:00 or "
            f"UTC; got {text!r}"
        )
    return offset


def parse_moment(text: str) -> datetime:
    """Return the moment that an ISO 8601 text with a zone names; InputError without one."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise InputError(
            "--start is the first picture's moment with its zone, such as "
            f"2026-06-21T09:30:00+02:00; got {text!r}"
        )
    return moment


def sky_pictures(
    sources: Sequence[Path], clock: timedelta | None, start: datetime | None
) -> list[SkyPicture]:
    """Return the pictures of one recording, or of picture files, in order of time.

    Of a bracket it is the frame with the least exposure, in which the sun is clipped least. Of
    more than 500 pictures 500 are returned, evenly spread.

    Parameters
    ----------
    sources : sequence of Path
        A recording's folder, or pictures.
    clock : timedelta or None
        By how much the camera's clock is ahead of universal time, if the files do not tell.
    start : datetime or None
        Moment of the first picture, with its zone; the others follow at their own intervals.

    Raises
    ------
    InputError
        If a moment is not known, or files and arguments contradict each other.
    """
    if clock is not None and start is not None:
        raise InputError("--start names a moment with its zone; leave --time-zone out")
    if len(sources) == 1 and sources[0].is_dir():
        found = _of_recording(open_recording(sources[0]), clock, start)
    else:
        found = [_of_file(path, clock, start) for path in sources]
    found.sort(key=lambda picture: picture.timestamp_s)
    if start is not None:
        shift = start.timestamp() - found[0].timestamp_s
        found = [SkyPicture(each.name, each.timestamp_s + shift, each.read) for each in found]
    chosen = np.linspace(0, len(found) - 1, min(len(found), _MOST_PICTURES)).round().astype(int)
    return [found[number] for number in chosen]


def _of_recording(
    recording: Recording, clock: timedelta | None, start: datetime | None
) -> list[SkyPicture]:
    if recording.raised_timestamp_count:
        raise InputError(
            f"{recording.folder}: {recording.raised_timestamp_count} timestamps step back, so its "
            "clock was set meanwhile: cut the recording there"
        )
    found = []
    for frames in recording.brackets:
        darkest = min(frames, key=lambda each: each.time_s * each.gain / (each.f_number or 1) ** 2)

        timestamp_s = darkest.timestamp_s
        if start is None:
            if timestamp_s < _FIRST_DATE_S:
                raise InputError(
                    f"{recording.folder}: its timestamps count from a start that is no date "
                    f"({timestamp_s:g} s); give the first picture's moment with --start"
                )
            path = contained_file(recording.folder, darkest.file)
            timestamp_s = _universal_s(timestamp_s, path, clock)
        found.append(SkyPicture(darkest.file, timestamp_s, partial(_frame, recording, darkest)))
    return found


def _of_file(path: Path, clock: timedelta | None, start: datetime | None) -> SkyPicture:
    timestamp_s = read_exif(path).timestamp_s
    if timestamp_s is None:
        raise InputError(
            f"{path}: it does not tell when it was taken; make a recording whose manifest does"
        )
    if start is None:
        timestamp_s = _universal_s(timestamp_s, path, clock)
    return SkyPicture(path.name, timestamp_s, partial(_picture, path))


def _frame(recording: Recording, record: FrameRecord) -> Counts:
    return recording.read_frame(record).counts, recording.sensor


def _picture(path: Path) -> Counts:
    file = read_camera_file(path)
    return file.counts, file.sensor()


def _universal_s(timestamp_s: float, path: Path, clock: timedelta | None) -> float:
    """Return a timestamp in universal time.

    EXIF with a zone has been turned into it, EXIF without was read as if it were it.
    """
    zone = read_exif(path).utc_offset
    if zone is not None and clock is not None and zone != clock:
        raise InputError(
            f"{path}: its EXIF says that its clock is {_hours(zone)} from universal time, "
            f"--time-zone {_hours(clock)}; leave it out or correct the files"
        )
    if zone is not None:
        return timestamp_s
    if clock is None:
        raise InputError(
            f"{path}: it does not tell the zone of its clock, and an hour is 15° of the sun's "
            "path; give --time-zone, such as +02:00, or UTC"
        )
    return timestamp_s - clock.total_seconds()


def _hours(offset: timedelta) -> str:
    return f"{offset.total_seconds() / 3600:+g} h"
