"""A camera in simulated time: frames at a rate, exposures that show after a delay, and faults.

The data of a frame hold its number and the exposure that it truly has, so that a test can tell
whether a label is right. The delay is counted from a setting to the stamp of a frame.
"""

import struct
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from capture.errors import CameraLost
from capture.sensor import srgb_encode
from capture.v4l2.stream import Delivery

SCENE = np.geomspace(0.02, 2000, 256)
"""Radiance of the pixels that `look` returns: light of 5 decades fills them at 0.5 ms to 50 s."""

_TRUTH = struct.Struct("<Id")


@dataclass
class SimulatedCamera:
    """A stream and its exposure control; times in seconds.

    Attributes
    ----------
    delay_s : float
        A frame stamped t has the last exposure set up to t − delay.
    wander_s, jitter_s : float
        By how much the delay varies from setting to setting, and stamps come late.
    transfer_s : float
        From a frame's stamp until it can be read.
    setting_s : float
        How long a setting takes.
    counts_at : float or None
        At which share of that time a setting takes effect; None draws one each time.
    lost, damaged : set of int
        Frames that never come, counted by the driver, and that come damaged.
    unplugged_s, silent_s : float
        When the camera goes, or stops sending; time begins at 1000.
    late : dict of int to float
        By how much single frames are late.
    """

    interval_s: float = 1 / 30
    delay_s: float = 0.08
    wander_s: float = 0.0
    jitter_s: float = 0.0
    transfer_s: float = 0.02
    setting_s: float = 0.002
    counts_at: float | None = None
    lost: set[int] = field(default_factory=set)
    damaged: set[int] = field(default_factory=set)
    unplugged_s: float = np.inf
    silent_s: float = np.inf
    late: dict[int, float] = field(default_factory=dict)
    buffers: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        self.time_s = 1000.0
        self._start_s = self.time_s
        self._random = np.random.default_rng(self.seed)
        self.effects: list[tuple[float, float]] = [(-np.inf, 0.01)]
        self._waiting: deque[Delivery] = deque()
        self._next = 0
        self._stamp_s = self._draw_stamp()

    def now_s(self) -> float:
        return self.time_s

    def pass_time(self, duration_s: float) -> None:
        """Do something else; frames pile up and are lost."""
        self.time_s += duration_s
        self._arrive()

    def set_exposure(self, time_s: float) -> float:
        """Set an exposure; the camera rounds to 0.1 ms."""
        self._check()
        actual_s = round(time_s, 4)
        share = self._random.uniform() if self.counts_at is None else self.counts_at
        effect_s = self.time_s + share * self.setting_s
        effect_s += self._random.uniform(-1, 1) * self.wander_s
        self.effects.append((effect_s, actual_s))
        self.pass_time(self.setting_s)
        return actual_s

    def next_frame(self, timeout_s: float) -> Delivery | None:
        self._check()
        self._arrive()
        end_s = min(self.time_s + max(timeout_s, 0.0), self.unplugged_s)
        while not self._waiting and self._stamp_s + self.transfer_s <= min(end_s, self.silent_s):
            self.time_s = max(self.time_s, self._stamp_s + self.transfer_s)
            self._arrive()
        if self._waiting:
            return self._waiting.popleft()
        self.time_s = end_s
        self._check()
        return None

    def look(self, data: bytes) -> NDArray[np.uint8]:
        """Return what SCENE looks like in a frame."""
        linear = np.clip(SCENE * self.exposure_of(data), 0, 1)
        return np.rint(255 * srgb_encode(linear)).astype(np.uint8)

    def change_interval(self, interval_s: float) -> None:
        """Send frames at another rate from now on."""
        self._start_s = self._exposed_s() - self._next * interval_s
        self.interval_s = interval_s
        self._stamp_s = self._draw_stamp()

    @staticmethod
    def exposure_of(data: bytes) -> float:
        """Return the exposure that a frame was made with."""
        return float(_TRUTH.unpack(data)[1])

    @staticmethod
    def number_of(data: bytes) -> int:
        return int(_TRUTH.unpack(data)[0])

    def level(self, data: bytes) -> float:
        return float(self.look(data).mean())

    def _check(self) -> None:
        if self.time_s >= self.unplugged_s:
            raise CameraLost("unplugged")

    def _exposed_s(self) -> float:
        return self._start_s + self._next * self.interval_s

    def _draw_stamp(self) -> float:
        late_s = self.late.get(self._next, self._random.exponential(self.jitter_s))
        return self._exposed_s() + late_s

    def _arrive(self) -> None:
        while self._stamp_s + self.transfer_s <= min(self.time_s, self.silent_s):
            number = self._next
            latched_s = self._exposed_s() - self.delay_s
            exposure_s = [value for time_s, value in self.effects if time_s <= latched_s][-1]
            if number not in self.lost and len(self._waiting) < self.buffers:
                data = _TRUTH.pack(number, exposure_s)
                self._waiting.append(
                    Delivery(data, number, self._stamp_s, is_damaged=number in self.damaged)
                )
            self._next += 1
            self._stamp_s = self._draw_stamp()
