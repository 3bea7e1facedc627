"""Frames, their exposures, and the brackets they form.

Input  : decoded camera files or buffers.    Output : Bracket, one moment at several exposures.
Counts are device numbers (DN), rows from the top, channels in the order R, G, B.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.errors import InputError, UnreadableFrame

TIME_RANGE_S = (1e-9, 1e9)
GAIN_RANGE = (1e-4, 1e6)
F_NUMBER_RANGE = (0.1, 1000.0)
"""What any camera does, with room; beyond, the merge's float32 would over- or underflow."""


@dataclass(frozen=True)
class Exposure:
    """How one frame was exposed.

    Attributes
    ----------
    time_s : float
        Exposure time, within TIME_RANGE_S.
    gain : float
        Amplification of the counts over the sensor's base sensitivity (ISO 200 on a sensor of
        base ISO 100 is 2), within GAIN_RANGE.
    f_number : float or None
        Aperture, within F_NUMBER_RANGE; None where the lens does not tell, which every frame of a
        bracket then shares.

    Raises
    ------
    InputError
        If one of them is out of its range, or not a number.
    """

    time_s: float
    gain: float = 1.0
    f_number: float | None = None

    def __post_init__(self) -> None:
        for name, value, (least, most) in (
            ("time_s", self.time_s, TIME_RANGE_S),
            ("gain", self.gain, GAIN_RANGE),
            ("f_number", self.f_number, F_NUMBER_RANGE),
        ):
            if value is not None and not least <= value <= most:
                raise InputError(
                    f"exposure {name} must be a number from {least:g} to {most:g}, got {value}"
                )

    @property
    def light(self) -> float:
        """Light per unit of radiance that reaches the sensor: time / f_number², in seconds."""
        return self.time_s / (self.f_number or 1.0) ** 2

    @property
    def signal(self) -> float:
        """Linear signal per unit of radiance: light × gain. Radiance = linear value / signal."""
        return self.light * self.gain


@dataclass(frozen=True, eq=False)
class Frame:
    """One exposure of the sensor.

    Attributes
    ----------
    counts : (H, W, 3) uint8, uint16 or float32
        DN in R, G, B order, read-only. Float counts are linear (EXR sequences).
    exposure : Exposure
    timestamp_s : float
        Start of the exposure on a clock that never steps back.
    index : int
        Number of the frame within its source, from 0.
    clipped : (H, W) bool, or None
        Pixels known to be lower bounds, of float counts only: others show it by their value.
    """

    counts: NDArray[Any]
    exposure: Exposure
    timestamp_s: float = 0.0
    index: int = 0
    clipped: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        counts = np.asarray(self.counts).view()
        if counts.ndim != 3 or counts.shape[2] != 3 or 0 in counts.shape:
            raise ValueError(f"counts must be (H, W, 3), got {counts.shape}")
        if counts.dtype not in (np.uint8, np.uint16, np.float32):
            raise ValueError(f"counts must be uint8, uint16 or float32, got {counts.dtype}")
        counts.flags.writeable = False
        object.__setattr__(self, "counts", counts)
        if self.clipped is not None:
            if counts.dtype != np.float32:
                raise ValueError(f"{counts.dtype} counts show by their value where they clip")
            mask = read_only("clipped", self.clipped, np.bool_, counts.shape[:2])
            object.__setattr__(self, "clipped", mask)

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height)."""
        return self.counts.shape[1], self.counts.shape[0]


@dataclass(frozen=True)
class Bracket:
    """The frames of one moment, in any order of exposure, all of one size and count type."""

    frames: tuple[Frame, ...]
    index: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", tuple(self.frames))
        if not self.frames:
            raise InputError(f"bracket {self.index} has no frames")
        first = self.frames[0]
        for frame in self.frames[1:]:
            if frame.size_px != first.size_px or frame.counts.dtype != first.counts.dtype:
                raise InputError(
                    f"all frames of a bracket must be alike: frame {first.index} is "
                    f"{first.size_px} {first.counts.dtype}, frame {frame.index} is "
                    f"{frame.size_px} {frame.counts.dtype}"
                )
        known = {frame.exposure.f_number is None for frame in self.frames}
        if len(known) > 1:
            raise InputError(
                f"bracket {self.index}: the f-number is known for some frames and not for others"
            )

    @property
    def timestamp_s(self) -> float:
        """Start of the first exposure."""
        return min(frame.timestamp_s for frame in self.frames)

    def by_signal(self) -> list[Frame]:
        """Return the frames from the darkest exposure to the brightest.

        Equal ones stand in the order of light, timestamp and index, so that the order in which the
        bracket holds them changes nothing.
        """
        return sorted(
            self.frames,
            key=lambda frame: (
                frame.exposure.signal,
                frame.exposure.light,
                frame.timestamp_s,
                frame.index,
            ),
        )


class FrameSource(Protocol):
    """Where brackets come from: a recording or a live camera.

    tests/capture/test_source_contract.py states what every implementation keeps to: indices rise,
    timestamps never fall, iteration ends, and a source can be iterated again: a recording from its
    start, a camera from then on. A bracket that cannot be read is delivered as the error that says
    why, so that one damaged file does not end a stream.
    """

    def __iter__(self) -> Iterator[Bracket | UnreadableFrame]: ...
