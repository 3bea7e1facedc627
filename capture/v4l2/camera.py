"""A live camera that brackets: opened, brought under manual control, and cycled through exposures.

Input  : CameraRequest.    Output : Bracket after Bracket, each exposure as the camera read it back.
Cost   : opening takes some 100 frames, in which the camera's delay is measured.
Fails  : exposures longer than the time between frames are not taken; ask for a lower rate. Gain is
         not changed. A driver that reads settings back from memory is believed unless pixels
         contradict it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from types import TracebackType
from typing import Self

import numpy as np

from capture.errors import CameraStalled, InputError, UnreadableFrame
from capture.frame import Bracket, Exposure, Frame
from capture.sensor import Sensor
from capture.v4l2.consistency import find_contradiction
from capture.v4l2.controls import list_controls, read_controls
from capture.v4l2.cycling import CameraCounters, Exposed, ExposureCycle
from capture.v4l2.finding import find_camera
from capture.v4l2.formats import PictureFormat, choose_format, choose_interval
from capture.v4l2.manual import ExposureControl, take_control
from capture.v4l2.node import VideoNode
from capture.v4l2.pixel_formats import (
    PIXEL_FORMATS,
    brightest_sample,
    decode,
    exposure_samples,
    pixel_sensor,
)
from capture.v4l2.settling import Settling, measure_settling
from capture.v4l2.stream import VideoStream

_ATTEMPTS = 3  # at measuring the delay; each allows for a frame more of doubt than the last
_PROOFS = 3  # brackets of two exposures that must come out right


@dataclass(frozen=True)
class CameraRequest:
    """Which camera, and how it is to be run; None leaves a choice to the camera.

    Attributes
    ----------
    device : str
        A path (/dev/video0, /dev/v4l/by-id/…), a name in /dev/v4l/by-id, the camera's own name, a
        part of it, or a number. Only by-id is sure to be the same camera after it was unplugged.
    size_px : (int, int) or None
        (width, height).
    pixel_format : str or None
        Four-character code: "YUYV", "MJPG", ….
    frame_rate_hz : float or None
        None takes the highest.
    seen_dn : int
        A count that the camera is known to send: formats of 16 bits do not tell their white, which
        is then above that at least.
    """

    device: str
    size_px: tuple[int, int] | None = None
    pixel_format: str | None = None
    frame_rate_hz: float | None = None
    seen_dn: int = 0


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """One frame as the camera sent it, its exposure known, its pixels not yet decoded.

    Attributes
    ----------
    data : bytes
        In the camera's pixel format; with "MJPG" a complete JPEG, perhaps without Huffman tables.
    exposure : Exposure
        As the camera read it back; gain 1 is the camera's least.
    timestamp_s : float
        CLOCK_MONOTONIC, as the driver stamped it: of USB cameras, when the frame began to arrive.
    index : int
        The driver's sequence number: a gap is a frame that was lost.
    """

    data: bytes
    exposure: Exposure
    timestamp_s: float
    index: int


class BracketCamera:
    """A camera under manual control that is streaming; made by `open_camera`, closed by `with`.

    To be used by one thread at a time. After CameraLost or CameraStalled it can only be closed.

    Attributes
    ----------
    name, driver : str
    picture : PictureFormat
        Pixel format and size, as the driver gave them.
    sensor : Sensor
        What the pixel format implies; a measured response is better.
    settling : Settling
        How the camera follows its settings, and `frame_interval_s`, as measured.
    exposure_range_s : (float, float)
        Shortest and longest exposure.
    exposure_step_s : float
    counters : CameraCounters
        Without the frames by which the delay was measured.
    """

    def __init__(
        self,
        node: VideoNode,
        stream: VideoStream,
        picture: PictureFormat,
        exposure: ExposureControl,
        range_s: tuple[float, float],
        seen_dn: int,
    ) -> None:
        self._node = node
        self._stream = stream
        self._exposure = exposure
        self._seen_dn = seen_dn
        self._brackets = 0
        self.name, self.driver = node.card, node.driver
        self.picture = picture
        self.exposure_range_s = range_s
        self.exposure_step_s = exposure.unit_s * exposure.control.step
        self.counters = CameraCounters()
        self.settling, self.sensor, self._cycle = self._calibrate()

    @property
    def pixel_format(self) -> str:
        """Four-character code."""
        return self.picture.fourcc

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height)."""
        return self.picture.size_px

    @property
    def frame_interval_s(self) -> float:
        """Time between frames, as measured."""
        return self.settling.frame_interval_s

    def nearest_exposure(self, time_s: float) -> float:
        """Return the exposure time nearest to `time_s` that the camera can really do.

        Raises
        ------
        InputError
            If `time_s` is not above 0.
        """
        if not time_s > 0:
            raise InputError(f"an exposure time must be above 0 s, got {time_s}")
        shortest_s, longest_s = self.exposure_range_s
        return self._exposure.nearest(min(max(time_s, shortest_s), longest_s))

    def read_controls(self) -> dict[str, int]:
        """Return the present values of all controls by name; the exposure's is the last one set."""
        return read_controls(self._node)

    def capture(self, times_s: Sequence[float]) -> Bracket:
        """Return one bracket of the exposure times nearest to `times_s`, decoded.

        A camera whose delay is steady sends one bracket of N exposures in N frames, as long as the
        same times are asked for again within two frames.

        Raises
        ------
        UnreadableFrame
            If frames come, but are damaged or contradict their exposures; the next call goes on.
        CameraLost
            If the camera was unplugged.
        CameraStalled
            If it sends nothing any more, or does not follow its exposures any more.
        """
        frames = self.capture_undecoded(times_s)
        bracket = Bracket(tuple(map(self.decode, frames)), self._brackets)
        self._brackets += 1
        return bracket

    def capture_undecoded(self, times_s: Sequence[float]) -> tuple[CameraFrame, ...]:
        """Return the frames of one bracket as the camera sent them; raises as `capture`."""
        if not times_s:
            raise InputError(f"{self.name}: at least one exposure time is wanted")
        wanted_s = [self.nearest_exposure(time_s) for time_s in times_s]
        for _ in range(2):
            exposed = self._cycle.collect(wanted_s)
            contradiction = self._contradiction(exposed)
            if contradiction is None:
                return tuple(map(_camera_frame, exposed))
            self.counters.contradictions += 1
        try:
            self.settling, _, self._cycle = self._calibrate()
        except InputError as error:
            raise CameraStalled(f"{self.name}: no longer follows its exposures: {error}") from error
        raise UnreadableFrame(
            f"{self.name}: frames contradict their exposures ({contradiction}), because the light "
            "changes or the camera does not keep to its settings"
        )

    def decode(self, frame: CameraFrame) -> Frame:
        """Return a frame's counts; UnreadableFrame if its data are damaged."""
        counts = decode(frame.data, self.picture, self.sensor)
        return Frame(counts, frame.exposure, frame.timestamp_s, frame.index)

    def close(self) -> None:
        """Stop streaming and let go of the camera; harmless when it is gone or already closed."""
        self._stream.close()
        self._node.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _calibrate(self) -> tuple[Settling, Sensor, ExposureCycle]:
        """Measure the camera's delay, and prove it on brackets of its extreme exposures."""
        look = partial(exposure_samples, picture=self.picture)
        measure = partial(
            measure_settling,
            self._stream,
            self._exposure.set,
            lambda data: float(np.mean(look(data))),
            self.exposure_range_s,
        )
        for doubt_frames in range(_ATTEMPTS):
            settling = measure()
            if settling.doubt_s > settling.frame_interval_s:  # perhaps a busy machine upset a step
                settling = min(settling, measure(), key=lambda settling: settling.doubt_s)
            settling = settling.widened(doubt_frames)
            cycle = ExposureCycle(self._stream, self._exposure.set, look, settling, self.counters)
            try:
                proofs = [cycle.collect(self.exposure_range_s) for _ in range(_PROOFS)]
            except UnreadableFrame:
                continue
            longest = max(proofs[-1], key=lambda exposed: exposed.actual_s)
            brightest_dn = brightest_sample(longest.delivery.data, self.picture)
            sensor = pixel_sensor(self.picture, max(brightest_dn, self._seen_dn))
            if all(_rises(proof) for proof in proofs):
                return settling, sensor, cycle
        raise InputError(
            f"{self.name}: its frames do not follow its exposures with a delay that can be told"
        )

    def _contradiction(self, exposed: Sequence[Exposed]) -> str | None:
        times_s = [one.actual_s for one in exposed]
        return find_contradiction(times_s, [one.samples for one in exposed], self.sensor)


def open_camera(request: CameraRequest) -> BracketCamera:
    """Return a camera that streams under manual control, its settling measured.

    Raises
    ------
    InputError
        If there is no such camera, it does not offer what is asked for, another program uses it,
        an automatic cannot be turned off, or its pictures do not follow its exposure.
    CameraLost, CameraStalled
        If it is unplugged meanwhile, or sends nothing.
    """
    node = VideoNode(find_camera(request.device))
    try:
        picture = choose_format(node, request.pixel_format, request.size_px, PIXEL_FORMATS)
        interval_s = choose_interval(node, picture, request.frame_rate_hz)
        exposure = take_control(node, list_controls(node), picture.size_px[0])
        range_s = exposure.range_within(interval_s)
        stream = VideoStream(node)
    except BaseException:
        node.close()
        raise
    try:
        return BracketCamera(node, stream, picture, exposure, range_s, request.seen_dn)
    except BaseException:
        stream.close()
        node.close()
        raise


def _rises(proof: Sequence[Exposed]) -> bool:
    """Tell whether the longer of two exposures is the brighter one."""
    shorter, longer = sorted(proof, key=lambda exposed: exposed.actual_s)
    return float(np.mean(longer.samples)) > float(np.mean(shorter.samples))


def _camera_frame(exposed: Exposed) -> CameraFrame:
    delivery = exposed.delivery
    return CameraFrame(
        delivery.data, Exposure(exposed.actual_s), delivery.timestamp_s, delivery.sequence
    )
