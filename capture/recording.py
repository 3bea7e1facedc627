"""Recordings read back: a folder with a manifest and one file per frame.

Input  : a folder, as capture.recording_writer makes it or written by hand.
Output : Brackets, in order; for one that cannot be read, the reason.
Cost   : a SHA-256 of every file read (about 1.8 GB/s where the processor has SHA instructions),
         then its decoding, which takes ten times as long or more.
"""

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import msgspec

from capture.camera_files import read_camera_file
from capture.errors import InputError, UnreadableFrame
from capture.files import read_bytes
from capture.frame import Bracket, Exposure, Frame
from capture.manifest import (
    MANIFEST_NAME,
    FrameRecord,
    Manifest,
    check_relative,
    read_manifest,
    sensor_of,
)
from capture.raw import BLACK_DN, RAW_SUFFIXES, WHITE_DN
from capture.sensor import Sensor

_DECODERS = 4
"""Frames of a bracket that are decoded at a time; OpenCV decodes outside Python's lock."""


@dataclass(frozen=True)
class Recording:
    """A recording that was opened; its frames are read when they are asked for.

    Iterating gives each bracket in order, or the UnreadableFrame that says why it cannot be had,
    so that one damaged file does not end a replay. It can be iterated any number of times.

    Attributes
    ----------
    folder : Path
    manifest : Manifest
        As on the disk, journal included.
    sensor : Sensor
    calibration_path : Path or None
        The calibration that the recording carries.
    brackets : tuple of tuple of FrameRecord
        In order of frame index. Timestamps never fall: one that did was raised to the one before.
    raised_timestamp_count : int
        Frames whose timestamp was raised.
    """

    folder: Path
    manifest: Manifest
    sensor: Sensor
    calibration_path: Path | None
    brackets: tuple[tuple[FrameRecord, ...], ...]
    raised_timestamp_count: int

    def __len__(self) -> int:
        return len(self.brackets)

    def __iter__(self) -> Iterator[Bracket | UnreadableFrame]:
        # A core is left to whoever takes the brackets while the next one is decoded.
        decoders = max(1, min(_DECODERS, (os.cpu_count() or 1) - 1))
        for position in range(len(self)):
            try:
                yield self._read_bracket(position, decoders)
            except UnreadableFrame as error:
                yield error

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of every frame."""
        return self.brackets[0][0].size_px

    @property
    def bracket_timestamps_s(self) -> tuple[float, ...]:
        """Start of each bracket."""
        return tuple(frames[0].timestamp_s for frames in self.brackets)

    def read_bracket(self, position: int) -> Bracket:
        """Return the bracket at `position`, counted from 0.

        Raises
        ------
        UnreadableFrame
            If one of its frames cannot be read: without it the merge would be another one.
        IndexError
            If there are fewer brackets.
        """
        return self._read_bracket(position, _DECODERS)

    def _read_bracket(self, position: int, decoders: int) -> Bracket:
        """Read a bracket, so many frames at a time."""
        records = self.brackets[position]
        with ThreadPoolExecutor(min(len(records), decoders)) as pool:
            frames = tuple(pool.map(self.read_frame, records))
        try:
            bracket = Bracket(frames, records[0].bracket)
            self.sensor.check_counts(frames[0].counts.dtype)
        except InputError as error:
            raise UnreadableFrame(f"{self.folder}: {error}") from None
        return bracket

    def read_frame(self, record: FrameRecord) -> Frame:
        """Return one frame, after its digest and size were found to be as recorded.

        Raises
        ------
        UnreadableFrame
            If the file is missing, outside the folder, not what was recorded, or damaged.
        """
        try:
            path = contained_file(self.folder, record.file)
            if hashlib.sha256(read_bytes(path)).hexdigest() != record.sha256:
                raise UnreadableFrame(
                    f"{path}: the SHA-256 differs from {MANIFEST_NAME}; the file was changed or "
                    "damaged after it was recorded"
                )
            file = read_camera_file(path)
        except InputError as error:
            raise UnreadableFrame(str(error)) from None
        size_px = (file.counts.shape[1], file.counts.shape[0])
        for wanted, owner in (
            (record.size_px, "is recorded for it"),
            (self.size_px, "others have"),
        ):
            if size_px != tuple(wanted):
                raise UnreadableFrame(
                    f"{path} has {size_px[0]}×{size_px[1]} px, {wanted[0]}×{wanted[1]} {owner}"
                )
        exposure = Exposure(record.time_s, record.gain, record.f_number)
        return Frame(file.counts, exposure, record.timestamp_s, record.index, file.clipped)


def open_recording(folder: Path) -> Recording:
    """Return the recording in `folder`, complete or as far as its writer came.

    Raises
    ------
    InputError
        If there is none, its manifest cannot be used, or it has no frames.
    """
    manifest = read_manifest(folder)
    if not manifest.frames:
        raise InputError(f"{folder}: the recording has no frames")
    calibration_path = None
    if manifest.calibration is not None:
        calibration_path = contained_file(folder, manifest.calibration)
    frames, raised_count = _with_rising_timestamps(manifest.frames)
    brackets = tuple(tuple(group) for _, group in groupby(frames, key=lambda frame: frame.bracket))
    try:
        sensor = sensor_of(manifest.sensor)
    except InputError as error:
        raise InputError(f"{folder / MANIFEST_NAME}: {error}") from None
    if any(Path(frame.file).suffix.lower() in RAW_SUFFIXES for frame in frames) and (
        (sensor.black_dn, sensor.white_dn) != (BLACK_DN, WHITE_DN)
    ):
        raise InputError(
            f"{folder}: RAW files whose sensor is black at {sensor.black_dn:g} and white at "
            f"{sensor.white_dn:g}, as an earlier fishlight read them; import them again"
        )
    return Recording(folder, manifest, sensor, calibration_path, brackets, raised_count)


def contained_file(folder: Path, name: str) -> Path:
    """Return the path of a regular file inside `folder`.

    Raises
    ------
    InputError
        If `name` is absolute, climbs, does not exist, is not a regular file (a device, a pipe) or
        is a symbolic link that leaves the folder.
    """
    check_relative(name)
    try:
        root = os.path.realpath(folder, strict=True)
        target = Path(os.path.realpath(folder / name, strict=True))
        inside, regular = target.is_relative_to(root), target.is_file()
    except FileNotFoundError:
        raise InputError(f"{folder / name}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: {name!r} is no path of a file ({error})") from None
    if not inside:
        raise InputError(f"{folder / name}: a link that leaves the recording's folder")
    if not regular:
        raise InputError(f"{folder / name}: not a regular file")
    return folder / name


def _with_rising_timestamps(
    frames: tuple[FrameRecord, ...],
) -> tuple[list[FrameRecord], int]:
    """Raise every timestamp that is below the one before, and count those."""
    rising: list[FrameRecord] = []
    raised_count = 0
    for frame in frames:
        if rising and frame.timestamp_s < rising[-1].timestamp_s:
            frame = msgspec.structs.replace(frame, timestamp_s=rising[-1].timestamp_s)
            raised_count += 1
        rising.append(frame)
    return rising, raised_count
