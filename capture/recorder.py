"""A live camera recorded: capture never waits for the disk, and what is written can be read.

Input  : CameraRequest.    Output : a recording's folder, and Recorded.
Three threads share the work: this one only takes brackets from the camera, one writes, one looks at
pixels to choose exposures. JPEG is stored as it came; other formats as TIFF without compression,
which costs 1 ms of computing for 1280×720 pixels where PNG takes 50 ms at least, and a third more
room. When QUEUED_BRACKETS wait for the disk, further ones are dropped and counted.
Ends   : asked to, or by an error, the recording is completed; killed, it is readable up to the last
         bracket written (capture.recording_writer).
Fails  : chosen exposures follow a change of the scene a bracket later than the live source's.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2

from capture.errors import InputError, UnreadableFrame
from capture.exposure_choice import ExposureChooser
from capture.frame import Bracket
from capture.manifest import DeviceRecord
from capture.recording_writer import (
    RecordingWriter,
    create_recording,
    read_calibration_bytes,
    replaces_recording,
)
from capture.reopening import CameraAway, Open, ReopeningCamera
from capture.v4l2.camera import BracketCamera, CameraFrame, CameraRequest, open_camera

QUEUED_BRACKETS = 16
"""About two seconds of a disk that hesitates, and 130 MB of 1280×720 pixels in three exposures."""

_JPEG_FORMATS = ("MJPG", "JPEG")
_UNCOMPRESSED = (cv2.IMWRITE_TIFF_COMPRESSION, cv2.IMWRITE_TIFF_COMPRESSION_NONE)


@dataclass
class Recorded:
    """What a recording holds, and what it lacks.

    captured = written + dropped + damaged, when it is complete.

    Attributes
    ----------
    captured, written, dropped, damaged : int
        Brackets from the camera; on the disk; lost to a slow disk; with frames that do not decode.
    frames : int
        Frames on the disk.
    unreadable : int
        Brackets that the camera could not give.
    gaps : int
        Frames that the camera lost by its own count, while it was last open.
    reopened_count : int
        How often the camera came back.
    times_s : tuple of float
        Exposures of the last bracket.
    trouble : str
        Why there is no bracket for now, or "".
    ended_by : BaseException or None
        What ended the recording before its time; to be raised when it was told.
    """

    captured: int = 0
    written: int = 0
    dropped: int = 0
    damaged: int = 0
    frames: int = 0
    unreadable: int = 0
    gaps: int = 0
    reopened_count: int = 0
    times_s: tuple[float, ...] = ()
    trouble: str = ""
    ended_by: BaseException | None = None


@dataclass(frozen=True)
class Length:
    """When a recording ends by itself: after so many brackets, or so long; None means never."""

    brackets: int | None = None
    duration_s: float | None = None


UNLIMITED = Length()


def record(
    request: CameraRequest,
    folder: Path,
    *,
    exposures_s: Sequence[float] | None = None,
    mains_hz: float | None = None,
    length: Length = UNLIMITED,
    calibration: Path | None = None,
    force: bool = False,
    stopped: threading.Event,
    report: Callable[[Recorded], None] = lambda _recorded: None,
    open_camera: Open = open_camera,
) -> Recorded:
    """Record a camera until `length` is reached or `stopped` is set, and return what came of it.

    Parameters
    ----------
    request : CameraRequest
    folder : Path
        The recording.
    exposures_s, mains_hz
        As in capture.exposure_choice.ExposureChooser.
    length : Length
    calibration, force
        As in capture.recording_writer.create_recording.
    stopped : Event
        Ends the recording within a bracket.
    report : callable
        Told before every bracket.
    open_camera : callable

    Raises
    ------
    InputError, CameraLost, CameraStalled
        If the camera cannot be opened, the folder not be made, or not one bracket was written: then
        nothing is left behind. Also if the disk is too full to complete the recording, which stays
        readable.
    """
    replaces_recording(folder, force=force)  # refused before the camera is opened
    if calibration is not None:
        read_calibration_bytes(calibration)
    recorded = Recorded()
    with ReopeningCamera(request, stopped, open_camera) as camera:
        first = camera.first
        chooser = ExposureChooser(first, exposures_s, mains_hz)
        with create_recording(
            folder,
            first.name,
            first.sensor,
            calibration=calibration,
            source=f"recorded from {request.device}",
            device=DeviceRecord(
                request.device,
                first.pixel_format,
                first.frame_interval_s,
                first.driver,
                first.read_controls(),
            ),
            force=force,
        ) as writer:
            end_s = time.monotonic() + (length.duration_s or math.inf)
            most = length.brackets or math.inf

            def goes_on() -> bool:
                report(recorded)
                is_full = recorded.captured >= most or time.monotonic() >= end_s
                return not (is_full or stopped.is_set())

            try:
                _record_brackets(camera, chooser, writer, recorded, goes_on)
            except BaseException as error:  # kept too: it would cost what was recorded
                recorded.ended_by = error
            recorded.reopened_count = camera.reopened_count
            if not recorded.written:
                raise recorded.ended_by or InputError(
                    f"{request.device}: not one bracket came ({recorded.trouble or 'stopped'})"
                )
    return recorded


@dataclass(frozen=True)
class _Taken:
    """A bracket as it came, and the numbers that it gets in the recording."""

    camera: BracketCamera
    frames: tuple[CameraFrame, ...]
    number: int
    first_index: int


def _record_brackets(
    camera: ReopeningCamera,
    chooser: ExposureChooser,
    writer: RecordingWriter,
    recorded: Recorded,
    goes_on: Callable[[], bool],
) -> None:
    """Keep the camera busy, and hand what it gives to the two other threads.

    However it ends, what waits for the disk is written first.
    """
    frame_count = 0
    writing: deque[Future[None]] = deque()
    looking: Future[None] | None = None
    with (
        ThreadPoolExecutor(1, "fishlight-writer") as writers,
        ThreadPoolExecutor(1, "fishlight-meter") as meters,
    ):
        while goes_on():
            try:
                device, frames = camera.take(partial(_capture, times_s=chooser.times_s))
            except UnreadableFrame as error:
                recorded.trouble = str(error)
                recorded.unreadable += not isinstance(error, CameraAway)
                continue
            taken = _Taken(device, frames, recorded.captured, frame_count)
            recorded.captured += 1
            recorded.times_s = tuple(frame.exposure.time_s for frame in frames)
            recorded.gaps, recorded.trouble = device.counters.gaps, ""
            frame_count += len(frames)
            while writing and writing[0].done():
                writing.popleft().result()
            if len(writing) < QUEUED_BRACKETS:
                writing.append(writers.submit(_write, writer, taken, recorded))
            else:
                recorded.dropped += 1
            if looking is None or looking.done():
                if looking is not None:
                    looking.result()
                looking = meters.submit(_look, chooser, taken)
        for write in writing:
            write.result()


def _capture(
    camera: BracketCamera, times_s: Sequence[float]
) -> tuple[BracketCamera, tuple[CameraFrame, ...]]:
    return camera, camera.capture_undecoded(times_s)


def _write(writer: RecordingWriter, taken: _Taken, recorded: Recorded) -> None:
    """Write a bracket; nothing of one that does not decode."""
    try:
        encoded = [_encoded(taken.camera, frame) for frame in taken.frames]
    except UnreadableFrame:
        recorded.damaged += 1
        return
    with writer.whole_bracket():
        for position, (data, suffix) in enumerate(encoded):
            frame = taken.frames[position]
            writer.write_encoded(
                data,
                suffix,
                taken.camera.size_px,
                frame.exposure,
                frame.timestamp_s,
                taken.number,
                index=taken.first_index + position,
                sequence=frame.index,
            )
    recorded.frames += len(encoded)
    recorded.written += 1


def _encoded(camera: BracketCamera, frame: CameraFrame) -> tuple[bytes, str]:
    """Return a frame's file, without loss, and its suffix."""
    if camera.pixel_format in _JPEG_FORMATS:
        return frame.data, ".jpg"
    picture = cv2.cvtColor(camera.decode(frame).counts, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".tif", picture, _UNCOMPRESSED)[1].tobytes(), ".tif"


def _look(chooser: ExposureChooser, taken: _Taken) -> None:
    """Choose the next exposures by a bracket, unless they are fixed or it is damaged."""
    if chooser.is_fixed:
        return
    with suppress(UnreadableFrame):
        bracket = Bracket(tuple(map(taken.camera.decode, taken.frames)), taken.number)
        chooser.look_at(bracket, taken.camera)
