"""Where a live session's brackets come from: a camera, or a recording played at its own pace.

Input  : a device's or a folder's name.    Output : Brackets whose timestamps are time.monotonic's.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path

from capture.errors import UnreadableFrame
from capture.frame import Bracket
from capture.live_source import LiveSource
from capture.recording import Recording, open_recording
from capture.v4l2.camera import CameraRequest

_FALLBACK_INTERVAL_S = 1 / 25  # between brackets whose timestamps do not tell
_LATE_S = 0.05


class PacedRecording:
    """A FrameSource: a recording's brackets, each when it is due; over and over unless `once`.

    One that is due is decoded then, as a camera's is. Timestamps and indices go on rising from one
    round to the next; only `repeat` gives a bracket again as it was.

    Attributes
    ----------
    name : str
    size_px : (int, int)
    sensor : Sensor
    calibration_path : Path or None
    reopened_count : int
        0: a recording is always there.
    """

    reopened_count = 0

    def __init__(
        self, recording: Recording, *, once: bool = False, rate_hz: float | None = None
    ) -> None:
        """Play `recording`, at `rate_hz` brackets a second in place of its own pace if given."""
        self.name = recording.folder.name
        self.size_px = recording.size_px
        self.sensor = recording.sensor
        self.calibration_path = recording.calibration_path
        self._recording = recording
        self._once = once
        self._rate_hz = rate_hz
        self._is_stopped = False
        self._woken = threading.Event()

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._is_stopped = True
        self._woken.set()

    def repeat(self) -> None:
        """Give the last bracket again without waiting for the next to be due; from any thread."""
        self._woken.set()

    def __iter__(self) -> Iterator[Bracket | UnreadableFrame]:
        offsets_s, length_s = _pace(self._recording.bracket_timestamps_s, self._rate_hz)
        begin_s = time.monotonic()
        number = frame_number = 0
        last: Bracket | None = None
        while True:
            for position, offset_s in enumerate(offsets_s):
                due_s = begin_s + offset_s
                while self._woken.wait(max(due_s - time.monotonic(), 0.0)):
                    if self._is_stopped:
                        return
                    self._woken.clear()
                    if last is not None:
                        yield last
                late_s = time.monotonic() - due_s
                if late_s > _LATE_S:  # decoding is slower than the recording: it then plays slower
                    begin_s, due_s = begin_s + late_s, due_s + late_s
                try:
                    read = self._recording.read_bracket(position)
                except UnreadableFrame as error:
                    yield error
                else:
                    last = _restamped(read, due_s - read.timestamp_s, number, frame_number)
                    yield last
                number += 1
                frame_number += len(self._recording.brackets[position])
            if self._once:
                return
            begin_s += length_s


Source = LiveSource | PacedRecording


def is_recording(name: str) -> bool:
    """Whether a source is a recording's folder, and not a camera."""
    return Path(name).is_dir()


def open_source(
    request: CameraRequest,
    *,
    exposures_s: tuple[float, ...] | None = None,
    mains_hz: float | None = None,
    once: bool = False,
) -> AbstractContextManager[Source]:
    """Return the camera, or the recording whose folder `request.device` names.

    Raises
    ------
    InputError, CameraLost, CameraStalled
        As `open_recording` and `LiveSource`.
    """
    if is_recording(request.device):
        recording = open_recording(Path(request.device))
        return nullcontext(PacedRecording(recording, once=once, rate_hz=request.frame_rate_hz))
    return LiveSource(request, exposures_s=exposures_s, mains_hz=mains_hz)


def _pace(times_s: tuple[float, ...], rate_hz: float | None) -> tuple[list[float], float]:
    """Return when each bracket is due after the first, and when the next round begins."""
    duration_s = times_s[-1] - times_s[0]
    if rate_hz is not None or not duration_s > 0:
        interval_s = _FALLBACK_INTERVAL_S if rate_hz is None else 1 / rate_hz
        return [position * interval_s for position in range(len(times_s))], (
            len(times_s) * interval_s
        )
    interval_s = duration_s / (len(times_s) - 1)
    return [time_s - times_s[0] for time_s in times_s], duration_s + interval_s


def _restamped(bracket: Bracket, shift_s: float, number: int, first_index: int) -> Bracket:
    frames = tuple(
        replace(frame, timestamp_s=frame.timestamp_s + shift_s, index=first_index + position)
        for position, frame in enumerate(bracket.frames)
    )
    return Bracket(frames, number)
