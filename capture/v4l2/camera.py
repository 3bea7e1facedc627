"""A live camera that brackets: opened, brought under manual control, and cycled through exposures.

Input  : CameraRequest.    Output : Bracket after Bracket, each exposure as the camera read it back.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from capture.frame import Bracket, Exposure, Frame
from capture.sensor import Sensor


@dataclass(frozen=True)
class CameraRequest:
    """Which camera, and how it is to be run; None leaves a choice to the camera.

    Attributes
    ----------
    device : str
        A path (/dev/video0, /dev/v4l/by-id/…), a name in /dev/v4l/by-id, the camera's own name or
        a number.
    size_px : (int, int) or None
        (width, height).
    pixel_format : str or None
        Four-character code: "YUYV", "MJPG", ….
    frame_rate_hz : float or None
    """

    device: str
    size_px: tuple[int, int] | None = None
    pixel_format: str | None = None
    frame_rate_hz: float | None = None


@dataclass
class CameraCounters:
    """What became of the frames that the camera sent.

    frames = used + skipped_settling + surplus + errors + stale. `gaps` are frames that never came.
    """

    frames: int = 0
    used: int = 0
    skipped_settling: int = 0
    surplus: int = 0
    errors: int = 0
    stale: int = 0
    gaps: int = 0


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """One frame as the camera sent it, its exposure known, its pixels not yet decoded.

    Attributes
    ----------
    data : bytes
        In the camera's pixel format; with "MJPG" a complete JPEG file.
    exposure : Exposure
        As the camera read it back.
    timestamp_s : float
        CLOCK_MONOTONIC, as the driver stamped it.
    index : int
        The driver's sequence number: a gap is a frame that was lost.
    """

    data: bytes
    exposure: Exposure
    timestamp_s: float
    index: int


class BracketCamera:
    """A camera under manual control that is streaming; a context manager."""

    name: str
    pixel_format: str
    size_px: tuple[int, int]
    sensor: Sensor
    frame_interval_s: float
    exposure_range_s: tuple[float, float]
    exposure_step_s: float
    counters: CameraCounters

    def nearest_exposure(self, time_s: float) -> float:
        """Return the exposure time nearest to `time_s` that the camera can really do."""
        raise NotImplementedError

    def capture(self, times_s: Sequence[float]) -> Bracket:
        """Return one bracket of the given exposure times, decoded.

        Raises CameraLost, CameraStalled, or UnreadableFrame (the next call goes on).
        """
        raise NotImplementedError

    def capture_undecoded(self, times_s: Sequence[float]) -> tuple[CameraFrame, ...]:
        """Return the frames of one bracket as the camera sent them, e.g. for a recording."""
        raise NotImplementedError

    def decode(self, frame: CameraFrame) -> Frame:
        """Return a frame's counts; UnreadableFrame if its data are damaged."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop streaming and let go of the camera; harmless when it is gone or already closed."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def open_camera(request: CameraRequest) -> BracketCamera:
    """Return a camera that streams under manual control, its settling measured."""
    raise NotImplementedError
