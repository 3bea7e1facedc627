"""What a recording says about itself: manifest.json, and the journal of one being written.

The header is in manifest.json from the start. Each finished frame adds one line to frames.jsonl, so
a frame costs the same however long the recording is; closing folds the lines into manifest.json.
Whatever moment a writer is killed at, manifest.json and the journal's complete lines name exactly
the frames that are whole.

Input  : a recording's folder.    Output : Manifest; or the reverse.
Fails  : a manifest of another major version, or above MAX_BYTES, is refused, not guessed at.
"""

from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.files import read_bytes
from capture.frame import F_NUMBER_RANGE, GAIN_RANGE, TIME_RANGE_S
from capture.output import write_json
from capture.sensor import Sensor, assumed_sensor

SCHEMA = "fishlight-recording/1"
MANIFEST_NAME = "manifest.json"
JOURNAL_NAME = "frames.jsonl"

MAX_BYTES = 64 * 2**20
"""Largest manifest or journal that is read."""

MOST_FRAMES = 2**17
"""Most frames of a recording, over an hour at 30 a second: of at most 400 bytes each, so that the
manifest can be read."""

Positive = Annotated[float, msgspec.Meta(gt=0)]
Time = Annotated[float, msgspec.Meta(ge=TIME_RANGE_S[0], le=TIME_RANGE_S[1])]
Gain = Annotated[float, msgspec.Meta(ge=GAIN_RANGE[0], le=GAIN_RANGE[1])]
FNumber = Annotated[float, msgspec.Meta(ge=F_NUMBER_RANGE[0], le=F_NUMBER_RANGE[1])]
Share = Annotated[float, msgspec.Meta(gt=0, le=1)]
Index = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
Pixels = Annotated[int, msgspec.Meta(gt=0, lt=2**31)]
Text = Annotated[str, msgspec.Meta(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
"""Text that is shown to people: without characters that steer a terminal."""

_Row = tuple[float, float, float]


class SensorRecord(msgspec.Struct, frozen=True):
    """A Sensor as the manifest holds it; `response` is "linear", "srgb" or one row per count."""

    black_dn: Annotated[float, msgspec.Meta(ge=0)]
    white_dn: Positive
    response: Literal["linear", "srgb"] | list[_Row]
    saturation: Share
    full_well_e: Positive
    read_noise_e: Annotated[float, msgspec.Meta(ge=0)]
    source: Text = ""
    response_deviation: list[_Row] | None = None
    colour_matrix: Annotated[list[_Row], msgspec.Meta(min_length=3, max_length=3)] | None = None


class FrameRecord(msgspec.Struct, frozen=True):
    """One frame: where it is, how it was exposed, and the digest of its file.

    `file` is relative to the recording's folder. `index` is the number that the source gave the
    frame: a gap is a frame that was lost before it reached the disk. Frames with the same
    `bracket` form one. `sequence` is a live camera's own number, from 0 each time it was opened; it
    counts the frames between two settings as well.
    """

    file: str
    time_s: Time
    sha256: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
    size_px: tuple[Pixels, Pixels]
    index: Index
    bracket: Index
    timestamp_s: float = 0.0
    gain: Gain = 1.0
    f_number: FNumber | None = None
    sequence: Index | msgspec.UnsetType = msgspec.UNSET


class DeviceRecord(msgspec.Struct, frozen=True):
    """The live camera that was recorded: what it was called, and how it was run.

    `controls` are by name what the camera said when recording began; exposures are in the frames.
    """

    path: Text
    pixel_format: Text
    frame_interval_s: Positive
    driver: Text = ""
    controls: dict[Text, int] = {}


class Manifest(msgspec.Struct, frozen=True, kw_only=True):
    """All of manifest.json. `calibration` names a file of the folder; only live ones have a device.

    What is unset is not written.
    """

    schema: str = SCHEMA
    camera: Text
    sensor: SensorRecord
    calibration: str | None = None
    source: Text
    licence: Text
    device: DeviceRecord | msgspec.UnsetType = msgspec.UNSET
    frames: tuple[FrameRecord, ...] = ()


class _Schema(msgspec.Struct):
    schema: str


_FRAME = msgspec.json.Decoder(FrameRecord)


def read_manifest(folder: Path) -> Manifest:
    """Return the manifest of a recording, frames of its journal included, in order of index.

    Raises
    ------
    InputError
        If the folder holds no manifest, or one that is too large, of another version, not valid
        JSON, incomplete, or whose frames contradict one another or lie outside the folder.
    """
    path = folder / MANIFEST_NAME
    if not path.is_file():
        raise InputError(
            f"{folder} holds no {MANIFEST_NAME}, so it is not a recording; "
            "make one with `fishlight import`"
        )
    # The journal is read first: a writer that closes in between has folded it into the manifest.
    journal = _journal_frames(folder / JOURNAL_NAME)
    data = read_bytes(path, MAX_BYTES)
    try:
        schema = msgspec.json.decode(data, type=_Schema).schema
        if schema != SCHEMA:
            raise InputError(f"{path}: schema is {schema!r}, this fishlight reads {SCHEMA!r}")
        manifest = msgspec.json.decode(data, type=Manifest)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from None
    # A writer killed between folding the journal and removing it leaves its frames in both.
    frames = sorted({*manifest.frames, *journal}, key=lambda frame: frame.index)
    _check_frames(frames, path)
    return msgspec.structs.replace(manifest, frames=tuple(frames))


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write manifest.json, whole or not at all."""
    write_json(folder / MANIFEST_NAME, manifest)


def journal_line(frame: FrameRecord) -> bytes:
    """Return the journal's line for a finished frame."""
    return msgspec.json.encode(frame) + b"\n"


def sensor_record(sensor: Sensor) -> SensorRecord:
    """Return what the manifest holds for a Sensor."""
    return SensorRecord(
        black_dn=float(sensor.black_dn),
        white_dn=float(sensor.white_dn),
        response=_response_record(sensor),
        saturation=float(sensor.saturation),
        full_well_e=float(sensor.full_well_e),
        read_noise_e=float(sensor.read_noise_e),
        source=sensor.source,
        response_deviation=(
            None if sensor.response_deviation is None else _rows(sensor.response_deviation)
        ),
        colour_matrix=None if sensor.colour_matrix is None else _rows(sensor.colour_matrix),
    )


def sensor_of(record: SensorRecord) -> Sensor:
    """Return the Sensor that the manifest describes; InputError if it contradicts itself."""
    if record.response == "srgb":
        response = _srgb_response()
    elif record.response == "linear":
        response = None
    else:
        response = np.array(record.response, np.float64).reshape(-1, 3)
    try:
        return Sensor(
            black_dn=record.black_dn,
            white_dn=record.white_dn,
            response=response,
            saturation=record.saturation,
            full_well_e=record.full_well_e,
            read_noise_e=record.read_noise_e,
            source=record.source,
            response_deviation=(
                None
                if record.response_deviation is None
                else np.array(record.response_deviation, np.float64).reshape(-1, 3)
            ),
            colour_matrix=(
                None if record.colour_matrix is None else np.array(record.colour_matrix, np.float64)
            ),
        )
    except ValueError as error:
        raise InputError(f"the sensor cannot be used: {error}") from None


def check_relative(name: str) -> None:
    """Raise InputError unless `name` is a relative path that never climbs, in printable text."""
    path = PurePosixPath(name)
    climbs = path.is_absolute() or ".." in path.parts or "\\" in name
    if climbs or not path.parts or not name.isprintable():
        raise InputError(f"the path {name!r} must be relative and stay inside the recording")


def _response_record(sensor: Sensor) -> Literal["linear", "srgb"] | list[_Row]:
    if sensor.response is None:
        return "linear"
    if np.array_equal(sensor.response, _srgb_response()):
        return "srgb"
    return _rows(sensor.response)


def _rows(table: NDArray[np.float64]) -> list[_Row]:
    return [(float(red), float(green), float(blue)) for red, green, blue in table]


def _srgb_response() -> NDArray[np.float64]:
    response = assumed_sensor(np.uint8).response
    assert response is not None
    return response


def _journal_frames(path: Path) -> list[FrameRecord]:
    if not path.is_file() or path.stat().st_size == 0:
        return []
    # Without its line feed the last line is not complete: its writer was killed.
    lines = read_bytes(path, MAX_BYTES).split(b"\n")[:-1]
    frames = []
    for number, line in enumerate(lines, start=1):
        try:
            frames.append(_FRAME.decode(line))
        except (msgspec.MsgspecError, RecursionError) as error:
            raise InputError(f"{path}, line {number}: {error}") from None
    return frames


def _check_frames(frames: list[FrameRecord], path: Path) -> None:
    files = set()
    for frame in frames:
        check_relative(frame.file)
        if frame.file in files:
            raise InputError(f"{path}: frame {frame.file!r} is listed twice, with different data")
        files.add(frame.file)
    for before, after in pairwise(frames):
        if after.index == before.index:
            raise InputError(
                f"{path}: {before.file!r} and {after.file!r} both have index {after.index}"
            )
        if after.bracket < before.bracket:
            raise InputError(
                f"{path}: {after.file!r} of bracket {after.bracket} comes after "
                f"{before.file!r} of bracket {before.bracket}"
            )
