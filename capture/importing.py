"""Pictures, RAW files, EXR sequences and videos made into recordings.

Input  : files of other programs.    Output : a recording's folder, or one Bracket in memory.
Cost   : every file is decoded once, so that a recording never begins with a damaged one; a bracket
         is held in memory while it is checked.
Files keep their bytes; only the frames of a video are encoded anew, as PNG.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from capture.camera_files import read_camera_file
from capture.errors import InputError
from capture.exposure_check import exposure_warning
from capture.files import read_bytes
from capture.frame import Bracket, Exposure, Frame
from capture.photographs import (
    HINT,
    Photograph,
    check_alike,
    find_photographs,
    plan_brackets,
)
from capture.progress import progress
from capture.recording import Recording, open_recording
from capture.recording_writer import RecordingWriter, create_recording, replaces_recording
from capture.sensor import Sensor, assumed_sensor
from capture.video import VIDEO_SUFFIXES, read_video

REPEAT_TOLERANCE = 0.1
"""Mean relative difference of the counts of two frames that are said to be one exposure twice.
A third of a stop makes 11 % in sRGB counts; the largest motion that is aligned, up to 7 %.
"""

_COMPARED_PX = 2**18

Create = Callable[[str, Sensor], RecordingWriter]


@dataclass(frozen=True)
class Imported:
    """What an import made.

    Attributes
    ----------
    recording : Recording
    notes : tuple of str
        What was assumed or left out, one line each.
    """

    recording: Recording
    notes: tuple[str, ...]


def import_sources(
    sources: Sequence[Path],
    folder: Path,
    *,
    exposures_s: Sequence[float] | None = None,
    calibration: Path | None = None,
    source: str = "",
    licence: str = "",
    sensor: Sensor | None = None,
    force: bool = False,
) -> Imported:
    """Make a recording from a video file, from photographs or from an EXR sequence.

    Parameters
    ----------
    sources : sequence of Path
        One video; or picture, RAW or EXR files and folders of them.
    folder : Path
        The recording.
    exposures_s : sequence of float or None
        Exposure times of one bracket, in the order of the files, instead of what EXIF tells; for
        a video the one time of all frames.
    calibration, source, licence, force
        As in capture.recording_writer.create_recording.
    sensor : Sensor or None
        The camera's, where it was measured, instead of what the files tell or is assumed.

    Raises
    ------
    InputError
        If the files do not make a recording; nothing is written then.
    """
    if not sources:
        raise InputError("nothing to import: name photographs, a folder, a video or EXR files")
    for name, text in (("source", source), ("licence", licence)):
        if not text.isprintable():
            raise InputError(f"--{name} {text!r} is not text in one line")
    video = next((path for path in sources if path.suffix.lower() in VIDEO_SUFFIXES), None)
    if video is not None and len(sources) > 1:
        raise InputError(f"{video}: a video is imported alone")
    replaces_recording(folder, force=force)  # refused before the work, not after
    create = partial(
        create_recording,
        folder,
        calibration=calibration,
        source=source or _named(sources),
        licence=licence,
        force=force,
    )
    if video is None:
        notes = _import_photographs(sources, exposures_s, sensor, create)
    else:
        notes = _import_video(video, exposures_s, sensor, create)
    return Imported(open_recording(folder), notes)


def read_photo_bracket(
    sources: Sequence[Path],
    exposures_s: Sequence[float] | None = None,
    position: int = 0,
    sensor: Sensor | None = None,
) -> tuple[Bracket, Sensor, tuple[str, ...]]:
    """Return one bracket of photographs, their sensor, and what was assumed.

    `sensor` is the camera's, where it was measured.

    Raises
    ------
    InputError
        If the photographs form no brackets, there is none at `position`, its frames do not fit
        together, or a file cannot be decoded.
    """
    plan = plan_brackets(find_photographs(sources), exposures_s)
    if not 0 <= position < len(plan.brackets):
        raise InputError(
            f"there is no bracket {position}; the photographs form {len(plan.brackets)}, from 0 on"
        )
    photographs = plan.brackets[position]
    bracket, sensor = _decode(photographs, position, sensor)
    notes = [*plan.notes]
    if len(plan.brackets) > 1:
        notes.append(
            f"the photographs form {len(plan.brackets)} brackets, from 0 on; this is {position}"
        )
    notes += _exposure_warning(bracket, sensor, photographs, given=exposures_s is not None)
    return bracket, sensor, tuple(notes)


def check_has_response(frame: Frame, path: Path) -> None:
    """Raise InputError if a frame of `path` is radiance already: no response could be used."""
    if frame.counts.dtype == np.float32:
        raise InputError(f"{path} holds radiance, which has no response: no --response")


def _import_photographs(
    sources: Sequence[Path],
    exposures_s: Sequence[float] | None,
    measured: Sensor | None,
    create: Create,
) -> tuple[str, ...]:
    plan = plan_brackets(find_photographs(sources), exposures_s)
    sensor, size_px, warnings = _check_pixels(
        plan.brackets, measured, given=exposures_s is not None
    )
    with create(plan.camera, sensor) as writer:
        for position, photographs in enumerate(progress(plan.brackets, "copying")):
            for photograph in photographs:
                writer.write_encoded(
                    read_bytes(photograph.path),
                    photograph.path.suffix,
                    size_px,
                    photograph.exposure,
                    photograph.timestamp_s,
                    position,
                )
    if len(warnings) > 1:
        warnings[1:] = [f"other brackets like it: {len(warnings) - 1}"]
    return (*plan.notes, *warnings)


def _import_video(
    video: Path,
    exposures_s: Sequence[float] | None,
    measured: Sensor | None,
    create: Create,
) -> tuple[str, ...]:
    if exposures_s is not None and len(exposures_s) != 1:
        raise InputError(
            f"{video}: a video has one exposure time, {len(exposures_s)} were given; brackets "
            "are imported from photographs"
        )
    exposure = Exposure(exposures_s[0] if exposures_s else 1.0)
    frames = read_video(video)
    first = next(frames)  # a file that is no video is refused before anything is made
    sensor = measured or assumed_sensor(first.counts.dtype)
    sensor.check_counts(first.counts.dtype)
    with create("", sensor) as writer:
        for bracket, frame in enumerate(progress(chain([first], frames), "decoding")):
            writer.write_frame(
                frame.counts, exposure, frame.timestamp_s, bracket, index=frame.index
            )
    notes = [] if exposures_s else ["a video tells no exposure time: 1 s is assumed"]
    if lost_count := frame.index - bracket:
        notes.append(f"frames that could not be decoded, and are left out: {lost_count}")
    return tuple(notes)


def _named(sources: Sequence[Path]) -> str:
    first, last = (
        "".join(filter(str.isprintable, path.name)) for path in (sources[0], sources[-1])
    )
    return first if len(sources) == 1 else f"{first} to {last}, {len(sources)} files"


def _check_pixels(
    brackets: Sequence[Sequence[Photograph]], measured: Sensor | None, *, given: bool
) -> tuple[Sensor, tuple[int, int], list[str]]:
    """Decode every photograph; return the sensor and (width, height) that all share."""
    kinds: dict[Path, str] = {}
    warnings: list[str] = []
    for position, photographs in enumerate(progress(brackets, "checking")):
        bracket, sensor = _decode(photographs, position, measured)
        kinds[photographs[0].path] = _kind(bracket.frames[0])
        warnings += _exposure_warning(bracket, sensor, photographs, given=given)
    check_alike("size", list(kinds), list(kinds.values()))
    return sensor, bracket.frames[0].size_px, warnings


def _decode(
    photographs: Sequence[Photograph], position: int, measured: Sensor | None
) -> tuple[Bracket, Sensor]:
    """Return one bracket and its sensor, after its frames were found to fit together."""
    files = [read_camera_file(photograph.path) for photograph in photographs]
    frames = [
        Frame(file.counts, photograph.exposure, photograph.timestamp_s, index, file.clipped)
        for index, (file, photograph) in enumerate(zip(files, photographs, strict=True))
    ]
    paths = [photograph.path for photograph in photographs]
    check_alike("size", paths, [_kind(frame) for frame in frames])
    _check_repeats(frames, paths)
    if measured is not None:
        check_has_response(frames[0], paths[0])
    sensor = measured or files[0].sensor()
    sensor.check_counts(frames[0].counts.dtype)
    return Bracket(tuple(frames), position), sensor


def _check_repeats(frames: Sequence[Frame], paths: Sequence[Path]) -> None:
    """Raise InputError if two frames have the same exposure but not the same brightness."""
    seen: dict[Exposure, tuple[Frame, Path]] = {}
    for frame, path in zip(frames, paths, strict=True):
        other, other_path = seen.setdefault(frame.exposure, (frame, path))
        difference = 0.0 if other is frame else _relative_difference(frame, other)
        if difference > REPEAT_TOLERANCE:
            raise InputError(
                f"{other_path.name} and {path.name} have the same exposure "
                f"({frame.exposure.time_s:g} s) but differ by {difference:.0%}: an exposure is "
                f"wrong, or they are of two brackets; {HINT}"
            )


def _exposure_warning(
    bracket: Bracket, sensor: Sensor, photographs: Sequence[Photograph], *, given: bool
) -> tuple[str, ...]:
    """Return what the pixels say against the exposures; given ones are believed, EXIF is not."""
    try:
        warning = exposure_warning(bracket, sensor)
    except InputError as error:
        if not given:
            raise InputError(f"{photographs[0].path.parent}: {error}; {HINT}") from None
        warning = str(error)
    return (warning,) if warning else ()


def _relative_difference(frame: Frame, other: Frame) -> float:
    """Return the mean difference of two frames' counts over their mean, where not both are full.

    Counts are compared in order of size: a hand that moved between the frames, which is found only
    when they are merged, changes where they are but hardly what there is.
    """
    width_px, height_px = frame.size_px
    step = math.ceil(math.sqrt(width_px * height_px / _COMPARED_PX))
    first, second = (
        np.sort(each.counts[::step, ::step].reshape(-1, 3), axis=0).astype(np.float32)
        for each in (frame, other)
    )
    usable = np.minimum(first, second) < 0.98 * np.iinfo(frame.counts.dtype).max
    total = (first + second)[usable].sum()
    return float(2 * np.abs(first - second)[usable].sum() / total) if total > 0 else 0.0


def _kind(frame: Frame) -> str:
    width_px, height_px = frame.size_px
    return f"{width_px}×{height_px} px {frame.counts.dtype}"
