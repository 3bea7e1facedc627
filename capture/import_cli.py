"""`fishlight import`: other programs' files made into a recording."""

from pathlib import Path

from capture.arguments import Output, parse_exposures, size_text, tell
from capture.importing import import_sources
from capture.sensor_files import read_sensor


def import_(
    *sources: Path,
    output: Output,
    calibration: Path | None = None,
    exposures: str | None = None,
    response: Path | None = None,
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
    response
        The camera's response, as `calibrate response` writes it.
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
        sensor=None if response is None else read_sensor(response),
        force=force,
    )
    tell(imported.notes)
    recording = imported.recording
    frame_count = len(recording.manifest.frames)
    print(
        f"{output}: brackets {len(recording)}, frames {frame_count}, {size_text(recording.size_px)}"
    )
