"""`fishlight merge`: one bracket made into linear radiance."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from capture.arguments import Output, WholeNumber, parse_exposures, size_text, tell
from capture.errors import InputError
from capture.exposure_check import exposure_warning
from capture.frame import Bracket
from capture.importing import read_photo_bracket
from capture.manifest import MANIFEST_NAME
from capture.merge import merge_bracket
from capture.output import refuse_existing
from capture.radiance_files import write_radiance
from capture.recording import open_recording
from capture.sensor import Sensor, in_primaries


def merge(
    *sources: Path,
    output: Output,
    exposures: str | None = None,
    bracket: WholeNumber = 0,
    primaries: Literal["rec709", "rec2020", "acescg"] = "rec709",
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
    primaries
        What the output's red, green and blue are; it names them. Rec.709 cuts off the most
        saturated colours of RAW files.
    force
        Replace the output if it exists.
    """
    refuse_existing(output, force=force)
    times_s = None if exposures is None else parse_exposures(exposures)
    chosen, sensor, notes = _read_bracket(sources, times_s, bracket)
    image = merge_bracket(chosen, in_primaries(sensor, primaries))
    write_radiance(output, image, comments=f"sensor: {sensor.source}", force=force)
    tell((f"sensor: {sensor.source}", *notes))
    print(
        f"{output}: {size_text(image.size_px)} from {len(chosen.frames)} exposures, "
        f"clipped {image.clipped.mean():.3%}, not valid {1 - image.valid.mean():.3%}"
    )


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
