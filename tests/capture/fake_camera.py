"""A camera that is no camera: a scene seen through a sensor, and faults when they are wanted."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.errors import CameraLost
from capture.frame import Bracket, Exposure, Frame
from capture.sensor import Sensor, assumed_sensor
from capture.v4l2.camera import CameraFrame, CameraRequest
from capture.v4l2.cycling import CameraCounters
from tests.capture.simulated_bracket import record


@dataclass
class FakePort:
    """Where the camera is plugged in: its scene, and what will happen to it.

    Attributes
    ----------
    radiance : (H, W, 3) float64
        May be replaced at any time.
    faults : dict of int to Exception
        What a bracket raises instead, by its number since the first opening. CameraLost also
        unplugs the camera.
    openings_refused : list of Exception
        What the next openings raise, one each.
    """

    radiance: NDArray[np.float64]
    sensor: Sensor = field(default_factory=lambda: assumed_sensor(np.uint8))
    pixel_format: str = "MJPG"
    faults: dict[int, Exception] = field(default_factory=dict)
    openings_refused: list[Exception] = field(default_factory=list)
    brackets: int = 0
    open_count: int = 0
    cameras: list["FakeCamera"] = field(default_factory=list)
    requests: list[CameraRequest] = field(default_factory=list)

    def open(self, request: CameraRequest) -> "FakeCamera":
        self.open_count += 1
        self.requests.append(request)
        if self.openings_refused:
            raise self.openings_refused.pop(0)
        self.cameras.append(FakeCamera(self))
        return self.cameras[-1]


class FakeCamera:
    """What BracketCamera offers, in no time at all."""

    name, driver = "Fake fisheye", "fake"
    exposure_range_s = (1e-4, 0.0333)
    exposure_step_s = 1e-4
    frame_interval_s = 1 / 30

    def __init__(self, port: FakePort) -> None:
        self.port = port
        self.sensor = port.sensor
        self.pixel_format = port.pixel_format
        self.size_px = (port.radiance.shape[1], port.radiance.shape[0])
        self.is_open = True
        self.counters = CameraCounters()
        self._sequence = 0

    def read_controls(self) -> dict[str, int]:
        return {"White Balance, Automatic": 0, "Gain": 4}

    def nearest_exposure(self, time_s: float) -> float:
        shortest_s, longest_s = self.exposure_range_s
        return round(min(max(time_s, shortest_s), longest_s), 4)

    def capture_undecoded(self, times_s: Sequence[float]) -> tuple[CameraFrame, ...]:
        assert self.is_open
        number = self.port.brackets
        self.port.brackets += 1
        if number in self.port.faults:
            raise self.port.faults[number]
        frames = []
        for position, time_s in enumerate(times_s):
            self._sequence += 2  # every other frame is on the way from one exposure to another
            exposure = Exposure(self.nearest_exposure(time_s))
            stamp_s = 1000.0 + number / 10 + position / 30
            data = encoded(self._counts(exposure, number), self.pixel_format)
            frames.append(CameraFrame(data, exposure, stamp_s, self._sequence))
        return tuple(frames)

    def capture(self, times_s: Sequence[float]) -> Bracket:
        return Bracket(tuple(map(self.decode, self.capture_undecoded(times_s))))

    def decode(self, frame: CameraFrame) -> Frame:
        if self.pixel_format == "MJPG":
            counts = cv2.imdecode(np.frombuffer(frame.data, np.uint8), cv2.IMREAD_COLOR_RGB)
        else:
            dtype = np.uint8 if self.sensor.white_dn <= 255 else np.uint16
            counts = np.frombuffer(frame.data, dtype).reshape(*self.size_px[::-1], 3)
        return Frame(counts, frame.exposure, frame.timestamp_s, frame.index)

    def close(self) -> None:
        self.is_open = False

    def _counts(self, exposure: Exposure, seed: int) -> NDArray[np.uint8]:
        rng = np.random.default_rng(seed)
        return record(self.port.radiance, [exposure], self.sensor, rng).frames[0].counts


def encoded(counts: NDArray[np.uint8], pixel_format: str) -> bytes:
    if pixel_format == "MJPG":
        return cv2.imencode(".jpg", counts[..., ::-1])[1].tobytes()
    return counts.tobytes()


def scene(height: int = 12, width: int = 16, seed: int = 0) -> NDArray[np.float64]:
    """A room in which one exposure is not enough."""
    radiance = np.exp2(np.random.default_rng(seed).uniform(-1.0, 3.0, (height, width)))
    radiance[2:4, 3:5] = 2000.0
    return np.repeat(radiance[..., None], 3, axis=2)


UNPLUGGED = CameraLost("unplugged")
