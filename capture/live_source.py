"""A live camera as a source of brackets for the session, which keeps the newest.

Input  : CameraRequest.    Output : Bracket after Bracket; while there is none, the reason.
Cost   : decoding, between one bracket and the next: 4 ms a megapixel of JPEG; and 1 ms a megapixel
         and exposure to choose exposures, or 10 ms where counts have 16 bits.
Stops  : within a bracket, or 0.5 s while the camera is away. A camera that stalls is noticed after
         2 s, and opening one takes 3 s at 30 frames a second; neither can be stopped.
"""

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

from capture.errors import UnreadableFrame
from capture.exposure_choice import ExposureChooser
from capture.frame import Bracket
from capture.reopening import CameraAway, Open, ReopeningCamera
from capture.sensor import Sensor
from capture.v4l2.camera import CameraRequest, open_camera


@dataclass
class LiveCounters:
    """What a live source delivered: brackets, damaged ones, and ticks while the camera was away."""

    brackets: int = 0
    unreadable: int = 0
    away: int = 0


class LiveSource:
    """A FrameSource: brackets from now on, for as long as the camera is there; closed by `with`.

    Iterating ends after `stop`, and raises CameraLost when the camera is lost for good. While it
    is away, each half second a CameraAway tells the age of the last bracket, which is then stale.
    Iterated again, it goes on with what the camera sees then; indices go on rising.

    Attributes
    ----------
    name : str
    size_px : (int, int)
        (width, height).
    sensor : Sensor
    counters : LiveCounters
    """

    def __init__(
        self,
        request: CameraRequest,
        *,
        exposures_s: Sequence[float] | None = None,
        mains_hz: float | None = None,
        open_camera: Open = open_camera,
    ) -> None:
        """Open the camera; parameters are those of ReopeningCamera and ExposureChooser."""
        self._mains_hz = mains_hz
        self._stopped = threading.Event()
        self._camera = ReopeningCamera(request, self._stopped, open_camera)
        first = self._camera.first
        try:
            self._chooser = ExposureChooser(first, exposures_s, mains_hz)
        except BaseException:
            self._camera.close()
            raise
        self.name = first.name
        self.size_px: tuple[int, int] = first.size_px
        self.sensor: Sensor = first.sensor
        self.counters = LiveCounters()
        self._frame_count = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._camera.close()

    @property
    def reopened_count(self) -> int:
        """How often the camera came back."""
        return self._camera.reopened_count

    def stop(self) -> None:
        """End the iteration, or the next one if there is none; from any thread."""
        self._stopped.set()

    def choose_exposures(self, exposures_s: Sequence[float] | None) -> None:
        """Take other exposures from the next bracket on, or choose them if None; from any thread.

        Raises
        ------
        InputError
            If the camera cannot do them; those before are kept.
        """
        self._chooser = ExposureChooser(self._camera.first, exposures_s, self._mains_hz)

    def __iter__(self) -> Iterator[Bracket | UnreadableFrame]:
        while not self._stopped.is_set():
            try:
                camera, bracket = self._camera.take(
                    lambda camera: (camera, camera.capture(self._chooser.times_s))
                )
            except UnreadableFrame as error:
                if isinstance(error, CameraAway):
                    self.counters.away += 1
                else:
                    self.counters.unreadable += 1
                yield error
            else:
                yield self._numbered(bracket)
                self._chooser.look_at(bracket, camera)
        self._stopped.clear()

    def _numbered(self, bracket: Bracket) -> Bracket:
        """Return the bracket with numbers that go on rising when the camera was opened again."""
        frames = tuple(
            replace(frame, index=self._frame_count + position)
            for position, frame in enumerate(bracket.frames)
        )
        self._frame_count += len(frames)
        self.counters.brackets += 1
        return Bracket(frames, self.counters.brackets - 1)
