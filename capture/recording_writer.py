"""Recordings written: each frame is on the disk and listed before the next one comes.

Input  : frames, as arrays or as files encoded by a camera.    Output : a recording's folder.
A writer that is killed leaves a recording with every frame it had finished; of frames written
together, all or none. One whose block ends with an exception leaves nothing, and an older recording
in its place as it was.
Fails  : beyond MOST_FRAMES; what comes then belongs into another recording.
"""

import hashlib
import math
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec
from numpy.typing import NDArray

from capture.errors import InputError
from capture.files import read_bytes
from capture.frame import Exposure
from capture.manifest import (
    JOURNAL_NAME,
    MOST_FRAMES,
    DeviceRecord,
    FrameRecord,
    Manifest,
    journal_line,
    read_manifest,
    sensor_record,
    write_manifest,
)
from capture.output import PARTIAL_PREFIX, replacing
from capture.pictures import write_jpeg, write_png
from capture.sensor import Sensor

CALIBRATION_NAME = "calibration.json"
FRAMES_FOLDER = "frames"


def create_recording(
    folder: Path,
    camera: str,
    sensor: Sensor,
    *,
    calibration: Path | None = None,
    source: str = "",
    licence: str = "",
    device: DeviceRecord | None = None,
    force: bool = False,
) -> "RecordingWriter":
    """Return the writer of a new recording, to be used as a context manager.

    Parameters
    ----------
    folder : Path
        Made here; its parent must exist.
    camera : str
        Make and model, or whatever tells cameras apart.
    sensor : Sensor
    calibration : Path or None
        A calibration that is copied into the recording.
    source, licence : str
        Where the frames come from and what may be done with them.
    device : DeviceRecord or None
        The live camera, if one is recorded.
    force : bool
        Replace an older recording. It is written beside it and takes its place when complete; only
        a folder that holds a recording is ever replaced.

    Raises
    ------
    InputError
        If `folder` exists and may not be replaced, or the calibration is not a JSON object.
    """
    folder = folder.resolve()
    copied = None if calibration is None else read_calibration_bytes(calibration)
    replaced = replaces_recording(folder, force=force)
    target = folder
    try:
        if replaced:
            target = Path(
                tempfile.mkdtemp(prefix=f"{PARTIAL_PREFIX}{folder.name}-", dir=folder.parent)
            )
            target.chmod(folder.stat().st_mode & 0o777)
        else:
            target.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    header = Manifest(
        camera=camera,
        sensor=sensor_record(sensor),
        calibration=None if copied is None else CALIBRATION_NAME,
        source=source,
        licence=licence,
        device=msgspec.UNSET if device is None else device,
    )
    try:
        return RecordingWriter(target, folder, header, copied)
    except BaseException:
        shutil.rmtree(target)
        raise


def replaces_recording(folder: Path, *, force: bool) -> bool:
    """Whether a recording made at `folder` replaces one; False if the place is free.

    Raises
    ------
    InputError
        If `folder` exists and may not be replaced, or its parent is no folder.
    """
    parent = folder.resolve().parent
    if not parent.is_dir():
        raise InputError(f"{parent} is not a folder; {folder.name} cannot be made there")
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return False
    if not force:
        raise InputError(f"{folder} exists; give --force to replace it")
    if not folder.is_dir():
        raise InputError(f"{folder} is a file; a recording is a folder")
    try:
        read_manifest(folder)
    except InputError as error:
        raise InputError(
            f"{folder} is left alone, only a recording is replaced; remove it yourself ({error})"
        ) from None
    return True


class RecordingWriter:
    """Writes the frames of one recording; made by `create_recording`.

    A frame's file is complete before the journal names it, and what is named together is one write.
    """

    def __init__(
        self, folder: Path, destination: Path, header: Manifest, calibration: bytes | None
    ) -> None:
        self.folder = folder
        self._destination = destination
        self._header = header
        self._frames: list[FrameRecord] = []
        self._listed_count = 0
        self._holds = False
        (folder / FRAMES_FOLDER).mkdir()
        if calibration is not None:
            with replacing(folder / CALIBRATION_NAME) as partial:
                partial.write_bytes(calibration)
        write_manifest(folder, header)
        self._journal = (folder / JOURNAL_NAME).open("xb", buffering=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self._journal.close()
        if kind is not None:
            shutil.rmtree(self.folder)
            return
        manifest = msgspec.structs.replace(self._header, frames=tuple(self._frames))
        try:
            write_manifest(self.folder, manifest)
        except InputError as error:
            raise InputError(f"{error}; {self.folder} can be read as it is") from None
        (self.folder / JOURNAL_NAME).unlink()
        if self.folder != self._destination:
            self._take_place()

    @contextmanager
    def whole_bracket(self) -> Iterator[None]:
        """List the frames that the block writes once it ends, or none of them if it fails.

        So a disk that is full in the middle of a bracket leaves no bracket that lacks exposures.
        """
        self._holds = True
        try:
            yield
            self._list_frames()
        except BaseException:
            for frame in self._frames[self._listed_count :]:
                (self.folder / frame.file).unlink(missing_ok=True)
            del self._frames[self._listed_count :]
            raise
        finally:
            self._holds = False

    def write_frame(
        self,
        counts: NDArray[Any],
        exposure: Exposure,
        timestamp_s: float,
        bracket: int,
        *,
        index: int | None = None,
        jpeg_quality: int | None = None,
    ) -> None:
        """Write counts (H, W, 3) uint8 or uint16 as PNG, without loss, or as JPEG if so chosen.

        Parameters are those of `write_encoded`.
        """
        index = self._next_index(index, bracket, timestamp_s)
        path = self._path(index, ".png" if jpeg_quality is None else ".jpg")
        if jpeg_quality is None:
            write_png(path, counts)
        else:
            write_jpeg(path, counts, jpeg_quality)
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        size_px = (counts.shape[1], counts.shape[0])
        self._list(path, sha256, size_px, exposure, timestamp_s, bracket, index)

    def write_encoded(
        self,
        encoded: bytes,
        suffix: str,
        size_px: tuple[int, int],
        exposure: Exposure,
        timestamp_s: float,
        bracket: int,
        *,
        index: int | None = None,
        sequence: int | None = None,
    ) -> None:
        """Write a file that a camera encoded, byte for byte.

        Parameters
        ----------
        encoded : bytes
            The whole file.
        suffix : str
            Of the file name, with its dot: it tells the format.
        size_px : (int, int)
            (width, height) of the decoded picture.
        exposure : Exposure
        timestamp_s : float
            Start of the exposure; finite.
        bracket : int
            Number of the bracket the frame belongs to; never falls.
        index : int or None
            Number that the source gave the frame, above all before it, or None to count on. A gap
            stands for frames that were lost.
        sequence : int or None
            A live camera's own number.
        """
        index = self._next_index(index, bracket, timestamp_s)
        path = self._path(index, suffix.lower())
        with replacing(path) as partial:
            partial.write_bytes(encoded)
        sha256 = hashlib.sha256(encoded).hexdigest()
        self._list(path, sha256, size_px, exposure, timestamp_s, bracket, index, sequence)

    def _next_index(self, index: int | None, bracket: int, timestamp_s: float) -> int:
        if len(self._frames) >= MOST_FRAMES:
            raise InputError(
                f"{self._destination} holds {MOST_FRAMES} frames, as many as a recording may; go "
                "on in another"
            )
        least, least_bracket = 0, 0
        if self._frames:
            least, least_bracket = self._frames[-1].index + 1, self._frames[-1].bracket
        index = least if index is None else index
        if index < least or bracket < least_bracket:
            raise ValueError(f"frame {index} of bracket {bracket} comes after a later one")
        if not math.isfinite(timestamp_s):
            raise ValueError(f"timestamp_s must be finite, got {timestamp_s}")
        return index

    def _path(self, index: int, suffix: str) -> Path:
        return self.folder / FRAMES_FOLDER / f"{index:06d}{suffix}"

    def _list(
        self,
        path: Path,
        sha256: str,
        size_px: tuple[int, int],
        exposure: Exposure,
        timestamp_s: float,
        bracket: int,
        index: int,
        sequence: int | None = None,
    ) -> None:
        record = FrameRecord(
            file=path.relative_to(self.folder).as_posix(),
            time_s=float(exposure.time_s),
            sha256=sha256,
            size_px=size_px,
            index=index,
            bracket=bracket,
            timestamp_s=float(timestamp_s),
            gain=float(exposure.gain),
            f_number=None if exposure.f_number is None else float(exposure.f_number),
            sequence=msgspec.UNSET if sequence is None else sequence,
        )
        self._frames.append(record)
        if not self._holds:
            self._list_frames()

    def _list_frames(self) -> None:
        """Name in the journal the frames that it does not name yet: all of them, or none."""
        lines = b"".join(map(journal_line, self._frames[self._listed_count :]))
        whole = self._journal.tell()
        try:
            while lines:  # a disk that is nearly full takes a part of them
                lines = lines[self._journal.write(lines) :]
        except OSError as error:
            self._journal.seek(whole)
            self._journal.truncate()
            path = self._journal.name
            raise InputError(f"{path}: cannot be written ({error.strerror})") from None
        self._listed_count = len(self._frames)

    def _take_place(self) -> None:
        """Put the complete recording in the place of the older one.

        A kill between the two renames leaves both whole, under names that begin with a dot.
        """
        older = self._destination.parent / f".replaced{self.folder.name.removeprefix('.partial')}"
        self._destination.rename(older)
        self.folder.rename(self._destination)
        shutil.rmtree(older)


def read_calibration_bytes(path: Path) -> bytes:
    """Return what a recording takes over as its calibration; InputError if no JSON object."""
    data = read_bytes(path)
    try:
        msgspec.json.decode(data, type=dict[str, msgspec.Raw])
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"{path}: not a calibration, a JSON object is wanted ({error})") from None
    return data
