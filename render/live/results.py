"""What a session leaves on disk when it is asked to: snapshots, exports and recordings.

Input  : what was seen of a bracket, and requests.    Output : numbered files in one folder.
Cost   : a thread of its own encodes and writes. A recording's frames are TIFF without compression;
while several brackets wait for the disk, further ones are left out and counted.
Fails  : a disk that is full ends a recording, which can be read, and not the session.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import cv2

from capture.errors import FishlightError
from capture.frame import Bracket
from capture.recording_writer import RecordingWriter, create_recording
from capture.sensor import Sensor
from render.live.desk import Desk, Request, Seen
from render.live.saving import Say, answer, free_place, save

_WAITING = 6
"""Brackets of a recording that may wait for the disk: 20 MB for each exposure of 1280×720."""


_UNCOMPRESSED = (cv2.IMWRITE_TIFF_COMPRESSION, cv2.IMWRITE_TIFF_COMPRESSION_NONE)


class _Recording(NamedTuple):
    """A recording that is being written."""

    opened: ExitStack
    writer: RecordingWriter
    folder: Path


class Results:
    """Writes what a desk is asked for; a context manager, at the end of which all is written.

    Parameters
    ----------
    desk : Desk
        Is told what became of each request.
    folder : Path
        Made when the first result is.
    camera : str
    sensor : Sensor
    calibration_path : Path
    say : callable
    """

    def __init__(
        self,
        desk: Desk,
        folder: Path,
        camera: str,
        sensor: Sensor,
        calibration_path: Path,
        say: Say,
    ) -> None:
        self._desk = desk
        self._folder = folder
        self._camera = camera
        self._sensor = sensor
        self._calibration_path = calibration_path
        self._say = say
        self._thread = ThreadPoolExecutor(1, "fishlight-results")
        self._waiting: deque[Future[None]] = deque()
        self._recording: _Recording | None = None
        self._taken: Bracket | None = None
        self._written = self._left_out = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._thread.submit(self._close)
        self._thread.shutdown()

    def look_at(self, bracket: Bracket, seen: Seen) -> None:
        """Do what was asked for, with this bracket; it must not change any more.

        One that is shown again, since settings changed (sources.py), is recorded once.
        """
        for request in self._desk.requests():
            self._thread.submit(self._answer, request, partial(self._done, request, seen))
        if self._recording is None or bracket is self._taken:
            return
        self._taken = bracket
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft()
        if len(self._waiting) < _WAITING:
            self._waiting.append(self._thread.submit(self._record, bracket))
        else:
            self._left_out += 1

    def _answer(self, request: str, do: Callable[[], str]) -> None:
        answer(self._desk, self._say, request, do)

    def _done(self, request: Request, seen: Seen) -> str:
        if request == "record":
            recording = self._recording
            return self._begin_recording() if recording is None else self._end_recording(recording)
        return save(self._folder, request, seen)

    def _begin_recording(self) -> str:
        folder = free_place(self._folder, "recording", "")
        opened = ExitStack()
        writer = opened.enter_context(
            create_recording(
                folder,
                self._camera,
                self._sensor,
                calibration=self._calibration_path,
                source="recorded in a live session",
            )
        )
        self._written = self._left_out = 0
        self._recording = _Recording(opened, writer, folder)
        self._desk.is_recording = True
        return f"Recording to {folder}"

    def _end_recording(self, recording: _Recording, trouble: Exception | None = None) -> str:
        """Complete the recording; an error that ended it, or comes now, is raised with what is."""
        self._recording = None
        self._desk.is_recording = False
        try:
            recording.opened.close()
        except (FishlightError, OSError) as error:
            trouble = trouble or error
        left_out = f", {self._left_out} left out by a slow disk" if self._left_out else ""
        text = f"Recorded {recording.folder}: {self._written} brackets{left_out}"
        if isinstance(trouble, FishlightError | OSError):
            raise FishlightError(f"{trouble}. {text}; the session goes on") from trouble
        if trouble is not None:
            raise trouble
        return text

    def _record(self, bracket: Bracket) -> None:
        """Write a bracket, whole or not at all; an error ends the recording."""
        recording = self._recording
        if recording is None:
            return
        try:
            with recording.writer.whole_bracket():
                for frame in bracket.frames:
                    blue_first = cv2.cvtColor(frame.counts, cv2.COLOR_RGB2BGR)
                    tiff = cv2.imencode(".tif", blue_first, _UNCOMPRESSED)[1].tobytes()
                    recording.writer.write_encoded(
                        tiff,
                        ".tif",
                        frame.size_px,
                        frame.exposure,
                        frame.timestamp_s,
                        bracket.index,
                    )
            self._written += 1
        except Exception as error:
            self._answer("record", partial(self._end_recording, recording, error))

    def _close(self) -> None:
        if self._recording is not None:
            self._answer("record", partial(self._end_recording, self._recording))
