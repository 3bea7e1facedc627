"""The capture stage's commands: import, inspect, merge."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from capture.arguments import Output, WholeNumber
from capture.errors import InputError
from capture.exposure_check import exposure_warning
from capture.frame import Bracket
from capture.importing import import_sources, read_photo_bracket
from capture.inspecting import contact_sheet, describe, examine
from capture.manifest import MANIFEST_NAME
from capture.merge import merge_bracket
from capture.output import refuse_existing
from capture.pictures import write_png
from capture.radiance_files import write_radiance
from capture.recording import open_recording
from capture.sensor import Sensor


def import_(
    *sources: Path,
    output: Output,
    calibration: Path | None = None,
    exposures: str | None = None,
    licence: str = "",
    source: str = "",
    force: bool = False,
) -> None:
    """Make a recording from photographs, a video, or an EXR sequence.

    Photographs are put in order of their EXIF time and grouped into brackets by their EXIF
    exposures. Files keep their bytes.

    Parameters
    ----------
    sources
        Photographs (JPEG, PNG, TIFF, RAW) or EXR files, or a folder of them, or one video.
    output
        The recording, a folder.
    calibration
        The camera's cal.json, copied into the recording.
    exposures
        Exposure times in seconds, such as 0.001,0.01 or 1/1000,1/100, one for each frame of a
        bracket in the order of the files. They replace all that EXIF says about exposure.
    licence
        What may be done with the pictures.
    source
        Where the pictures come from.
    force
        Replace the recording if it exists.
    """
    imported = import_sources(
        sources,
        output,
        exposures_s=None if exposures is None else parse_exposures(exposures),
        calibration=calibration,
        source=source,
        licence=licence,
        force=force,
    )
    _tell(imported.notes)
    recording = imported.recording
    frame_count = len(recording.manifest.frames)
    print(f"{output}: brackets {len(recording)}, frames {frame_count}, {_size(recording.size_px)}")


def inspect(recording: Path, *, thumbnails: Path | None = None, force: bool = False) -> None:
    """Show what a recording holds, and whether every frame of it can be read.

    Parameters
    ----------
    recording
        A folder with a manifest.json.
    thumbnails
        Also write a sheet of thumbnails, a PNG: a row for each of up to 12 brackets.
    force
        Replace the sheet if it exists.
    """
    opened = open_recording(recording)
    if thumbnails is not None:
        if thumbnails.suffix.lower() != ".png":
            raise InputError(f"{thumbnails}: wanted a file named .png")
        refuse_existing(thumbnails, force=force)
    examination = examine(opened)
    _print_facts(describe(opened, examination))
    if thumbnails is not None:
        write_png(thumbnails, contact_sheet(opened), force=force)
    if examination.failures:
        count = len(examination.failures)
        raise InputError(f"{count} of {len(opened)} brackets: {examination.failures[0]}")


def merge(
    *sources: Path,
    output: Output,
    exposures: str | None = None,
    bracket: WholeNumber = 0,
    force: bool = False,
) -> None:
    """Merge one bracket to linear radiance.

    Parameters
    ----------
    sources
        A recording; or photographs, or a folder of them.
    output
        An EXR file with radiance, its variance and the masks `valid` and `clipped`; or .hdr,
        which keeps radiance alone.
    exposures
        Exposure times in seconds, as for `import`; not for a recording.
    bracket
        Which bracket, from 0.
    force
        Replace the output if it exists.
    """
    refuse_existing(output, force=force)
    times_s = None if exposures is None else parse_exposures(exposures)
    chosen, sensor, notes = _read_bracket(sources, times_s, bracket)
    image = merge_bracket(chosen, sensor)
    write_radiance(output, image, force=force)
    _tell((f"sensor: {sensor.source}", *notes))
    print(
        f"{output}: {_size(image.size_px)} from {len(chosen.frames)} exposures, "
        f"clipped {image.clipped.mean():.3%}, not valid {1 - image.valid.mean():.3%}"
    )


def parse_exposures(text: str) -> tuple[float, ...]:
    """Return the numbers of a list such as "0.001, 1/250, 2".

    Raises
    ------
    InputError
        If a part is neither a number nor a fraction. Whether a number makes an exposure time is
        not judged here.
    """
    return tuple(_seconds(part) for part in text.split(","))


def _seconds(part: str) -> float:
    numerator, slash, denominator = part.partition("/")
    try:
        return float(numerator) / float(denominator) if slash else float(numerator)
    except (ValueError, ZeroDivisionError):
        raise InputError(
            f"--exposures: {part.strip()!r} is no time in seconds; write 0.001,0.01 or 1/1000,1/100"
        ) from None


def _read_bracket(
    sources: Sequence[Path], exposures_s: Sequence[float] | None, position: int
) -> tuple[Bracket, Sensor, tuple[str, ...]]:
    if not sources:
        raise InputError("nothing to merge: name a recording, photographs or a folder of them")
    if len(sources) > 1 or not (sources[0] / MANIFEST_NAME).is_file():
        return read_photo_bracket(sources, exposures_s, position)
    recording = open_recording(sources[0])
    if exposures_s is not None:
        raise InputError(
            f"{sources[0]} is a recording and has its exposures; import it again to change them"
        )
    if not 0 <= position < len(recording):
        raise InputError(
            f"{sources[0]} has no bracket {position}; it has {len(recording)}, from 0 on"
        )
    chosen = recording.read_bracket(position)
    return chosen, recording.sensor, _exposure_notes(chosen, recording.sensor)


def _exposure_notes(bracket: Bracket, sensor: Sensor) -> tuple[str, ...]:
    # A recording's exposures were settled when it was made: doubt is told, not enforced.
    try:
        warning = exposure_warning(bracket, sensor)
    except InputError as error:
        warning = str(error)
    return (warning,) if warning else ()


def _print_facts(facts: Sequence[tuple[str, str]]) -> None:
    if not sys.stdout.isatty():
        for name, value in facts:
            print(f"{name}: {value}")
        return
    table = Table.grid(padding=(0, 2))
    for name, value in facts:
        table.add_row(Text(name, style="bold"), Text(value))
    Console().print(table)


def _tell(notes: Sequence[str]) -> None:
    for note in notes:
        print(f"note: {note}", file=sys.stderr)


def _size(size_px: tuple[int, int]) -> str:
    return f"{size_px[0]}×{size_px[1]} px"


COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = (
    (import_, "import"),
    (inspect, "inspect"),
    (merge, "merge"),
)
