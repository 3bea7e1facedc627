"""One bracket of whatever a user names: a recording, photographs, or a folder of them.

Input  : paths.    Output : Bracket and Sensor, and what was assumed or is doubted, for people.
"""

from collections.abc import Sequence
from pathlib import Path

from capture.errors import InputError
from capture.exposure_check import exposure_warning
from capture.frame import Bracket
from capture.importing import check_has_response, read_photo_bracket
from capture.manifest import MANIFEST_NAME
from capture.recording import open_recording
from capture.sensor import Sensor


def read_bracket(
    sources: Sequence[Path],
    exposures_s: Sequence[float] | None,
    position: int,
    measured: Sensor | None,
) -> tuple[Bracket, Sensor, tuple[str, ...]]:
    """Return the bracket at `position`, from 0, its sensor, and notes for people.

    Parameters
    ----------
    sources : sequence of Path
        A recording; or photographs and folders of them.
    exposures_s : sequence of float or None
        Exposure times of photographs, as in capture.importing.import_sources; not of a recording.
    position : int
    measured : Sensor or None
        The camera's, where it was measured, instead of the recording's or an assumed one.

    Raises
    ------
    InputError
        If there is no such bracket, it cannot be read, or the arguments contradict it.
    """
    if not sources:
        raise InputError("nothing to merge: name a recording, photographs or a folder of them")
    recordings = [path for path in sources if (path / MANIFEST_NAME).is_file()]
    if recordings and len(sources) > 1:
        raise InputError(f"{recordings[0]} is a recording; it is merged alone")
    if not recordings:
        return read_photo_bracket(sources, exposures_s, position, measured)
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
    if measured is not None:
        check_has_response(chosen.frames[0], sources[0])
    sensor = measured or recording.sensor
    sensor.check_counts(chosen.frames[0].counts.dtype)
    return chosen, sensor, _exposure_notes(chosen, sensor)


def _exposure_notes(bracket: Bracket, sensor: Sensor) -> tuple[str, ...]:
    # A recording's exposures were settled when it was made: doubt is told, not enforced.
    try:
        warning = exposure_warning(bracket, sensor)
    except InputError as error:
        warning = str(error)
    return (warning,) if warning else ()
