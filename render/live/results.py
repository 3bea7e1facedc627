"""What a session leaves on disk when it is asked to: snapshots, exports and recordings.

Input  : what was seen of a bracket, and requests.    Output : numbered files in one folder.
Cost   : a thread of its own encodes and writes. A recording's frames are TIFF without compression;
while several brackets wait for the disk, further ones are left out and counted.
"""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import cv2

from capture.errors import FishlightError
from capture.frame import Bracket
from capture.recording_writer import RecordingWriter, create_recording
from capture.sensor import Sensor
from lighting.export.files import write_scene
from lighting.export.rig import light_rig
from lighting.light_files import write_lights
from lighting.maps.environment_files import write_environment
from render.live.desk import Desk, Request, Seen
from render.output.pictures import write_picture

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
    """

    def __init__(
        self, desk: Desk, folder: Path, camera: str, sensor: Sensor, calibration_path: Path
    ) -> None:
        self._desk = desk
        self._folder = folder
        self._camera = camera
        self._sensor = sensor
        self._calibration_path = calibration_path
        self._thread = ThreadPoolExecutor(1, "fishlight-results")
        self._waiting: deque[Future[None]] = deque()
        self._recording: _Recording | None = None
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
        """Do what was asked for, with this bracket; it must not change any more."""
        for request in self._desk.requests():
            self._thread.submit(self._answered, request, seen)
        if self._recording is None:
            return
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft()
        if len(self._waiting) < _WAITING:
            self._waiting.append(self._thread.submit(self._record, bracket))
        else:
            self._left_out += 1

    def _answered(self, request: Request, seen: Seen) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            text = self._done(request, seen)
        except (FishlightError, OSError) as error:
            self._desk.answer(f"{request}: {error}", is_error=True)
        else:
            self._desk.answer(text)

    def _done(self, request: Request, seen: Seen) -> str:
        if request == "snapshot":
            return self._snapshot(seen)
        if request == "record":
            recording = self._recording
            return self._begin_recording() if recording is None else self._end_recording(recording)
        path = self._free("lights", f".{request.removeprefix('export-')}")
        write_scene(path, light_rig(seen.lights, seen.environment))
        return f"Exported {path}"

    def _snapshot(self, seen: Seen) -> str:
        """Write the lights, and the map and picture if there are any."""
        path = self._free("snapshot", ".json")
        write_lights(path, seen.lights)
        written = [path.name]
        if seen.environment is not None:
            write_environment(path.with_suffix(".exr"), seen.environment)
            written.append(path.with_suffix(".exr").name)
        if seen.picture is not None:
            write_picture(path.with_suffix(".png"), seen.picture, seen.view_ev)
            written.append(path.with_suffix(".png").name)
        return f"Saved {', '.join(written)} in {self._folder}"

    def _begin_recording(self) -> str:
        folder = self._free("recording", "")
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

    def _end_recording(self, recording: _Recording) -> str:
        self._recording = None
        self._desk.is_recording = False
        recording.opened.close()
        left_out = f", {self._left_out} left out by a slow disk" if self._left_out else ""
        return f"Recorded {recording.folder}: {self._written} brackets{left_out}"

    def _record(self, bracket: Bracket) -> None:
        """Write a bracket; an error ends the recording, and what was written can be read."""
        if self._recording is None:
            return
        writer = self._recording.writer
        try:
            for frame in bracket.frames:
                blue_first = cv2.cvtColor(frame.counts, cv2.COLOR_RGB2BGR)
                tiff = cv2.imencode(".tif", blue_first, _UNCOMPRESSED)[1].tobytes()
                writer.write_encoded(
                    tiff, ".tif", frame.size_px, frame.exposure, frame.timestamp_s, bracket.index
                )
            self._written += 1
        except (FishlightError, OSError) as error:
            self._desk.answer(f"{self._end_recording(self._recording)}: {error}", is_error=True)

    def _close(self) -> None:
        if self._recording is not None:
            self._desk.answer(self._end_recording(self._recording))

    def _free(self, kind: str, suffix: str) -> Path:
        """Return the first of kind-0001, kind-0002, … that is not there."""
        number = 1
        while any(self._folder.glob(f"{kind}-{number:04d}*")):
            number += 1
        return self._folder / f"{kind}-{number:04d}{suffix}"
