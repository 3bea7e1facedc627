"""When an exposure that was set shows in the frames, measured by steps between two exposures.

Domain : a camera latches its settings once a frame, some frames ahead. A setting made at time s is
         then in every frame stamped after s + D, and in none before; D is some 1 to 4 frames.
Input  : a running stream.    Output : Settling, bounds of D and the frame interval.
Cost   : some 90 frames.
Fails  : in a picture that does not depend on exposure (a covered lens), which is refused.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import NamedTuple

from capture.errors import CameraStalled, InputError, UnreadableFrame
from capture.v4l2.stream import Delivery, FrameStream

SetExposure = Callable[[float], float]
"""Sets an exposure time in seconds and returns the camera's own."""

START_S = 10.0
"""Longest wait for a first frame: some cameras take seconds to start."""

RECENT = 6
"""Frames whose stamps tell together how late each of them is."""

_STEPS = 12
_LEVEL_FRAMES = 12  # more than any camera's delay
_MOST_FRAMES = 40  # after which a step, or a frame that is whole, is taken not to come
_LEAST_CONTRAST = 0.01  # of the larger level
_OLD, _NEW = 0.2, 0.8  # shares of a step; between them the camera is on its way
_GUARD = 0.1  # frame intervals that delays may wander beyond what was measured
_WANDER = 0.1  # frame intervals, above which a delay is not taken for constant
_LEAST_AGE_S, _MOST_AGE_S = -0.1, 60.0  # of a frame that comes; some drivers estimate its time


@dataclass(frozen=True)
class Settling:
    """How a camera follows its settings.

    A setting that was made between `begun` and `done` is in no frame stamped before begun +
    `earliest_s`, and in all frames stamped from done + `latest_s` on. Making it takes `setting_s`.
    """

    earliest_s: float
    latest_s: float
    setting_s: float
    frame_interval_s: float

    @property
    def doubt_s(self) -> float:
        """For how long after a setting it is not known whether a frame has it."""
        return self.latest_s - self.earliest_s + self.setting_s

    def widened(self, frames: float) -> "Settling":
        """Return bounds further apart, for a camera that was caught beyond these."""
        half_s = frames * self.frame_interval_s / 2
        return replace(
            self,
            earliest_s=max(self.earliest_s - half_s, 0.0),
            latest_s=self.latest_s + half_s,
        )


class _Step(NamedTuple):
    """One change of exposure: when it was set, and the stamps between which it came."""

    begun_s: float
    done_s: float
    last_old_s: float
    first_changed_s: float
    last_unsettled_s: float
    first_new_s: float


def earliest_stamp(recent: Sequence[Delivery], interval_s: float) -> float:
    """Return when the last of some frames would have been stamped, had none of them been late.

    The truth lies between this and the last frame's own stamp: a machine that is busy stamps late,
    never early.
    """
    last = recent[-1]
    return min(
        frame.timestamp_s + (last.sequence - frame.sequence) * interval_s for frame in recent
    )


def measure_settling(
    stream: FrameStream,
    set_exposure: SetExposure,
    level_of: Callable[[bytes], float],
    times_s: tuple[float, float],
) -> Settling:
    """Return how a camera follows steps between two exposure times.

    The steps are set at even phases of the frame, so that a constant delay is found to within a
    twelfth of a frame; one that varies widens the bounds.

    Raises
    ------
    InputError
        If the picture's level hardly differs between the two, does not follow, or frames are
        stamped by another clock.
    CameraStalled, CameraLost
        As the stream.
    """
    frames = _FrameLog(stream, level_of)
    levels = []
    for time_s in times_s:
        set_exposure(time_s)
        for _ in range(_LEVEL_FRAMES):
            frames.read()
        levels.append(median(frames.levels[-3:]))
    dark, bright = levels
    if bright - dark < _LEAST_CONTRAST * max(bright, 1.0):
        raise InputError(
            f"the picture is as bright at {times_s[0]:.2g} s as at {times_s[1]:.2g} s (levels "
            f"{dark:.3g} and {bright:.3g}): is the lens covered, or the exposure automatic?"
        )
    interval_s = frames.interval_s()
    steps = []
    for index in range(_STEPS):
        to_bright = index % 2 == 1  # the last level was the bright one
        frames.read_until(stream.now_s() + index / _STEPS * interval_s)
        old, new = levels[not to_bright], levels[to_bright]
        steps.append(_step(frames, interval_s, set_exposure, times_s[to_bright], old, new))
    return _bounds(steps, frames.interval_s())


class _FrameLog:
    """Stamps and levels of the frames that came, in order, damaged ones left out."""

    def __init__(self, stream: FrameStream, level_of: Callable[[bytes], float]) -> None:
        self.stream = stream
        self.levels: list[float] = []
        self.recent: deque[Delivery] = deque(maxlen=RECENT)
        self._moments: list[tuple[int, float]] = []
        self._level_of = level_of
        self._damage = ""

    def read(self) -> None:
        """Wait for a frame that is whole."""
        for _ in range(_MOST_FRAMES):
            if self._take(self.stream.next_frame(START_S)):
                return
        raise CameraStalled(
            f"the camera sent {_MOST_FRAMES} damaged frames one after the other; of the last, "
            f"{self._damage}"
        )

    def read_until(self, time_s: float) -> None:
        """Take the frames that come until a time."""
        while (left_s := time_s - self.stream.now_s()) > 0:
            delivery = self.stream.next_frame(left_s)
            if delivery is not None:
                self._take(delivery)

    def interval_s(self) -> float:
        """Return the time between frames: the median over stretches of a quarter of those seen.

        Stretches average out what single stamps are late by, and one frame that was lost unseen
        lengthens fewer than half of them.
        """
        stretch = len(self._moments) // 4
        return median(
            (later_s - earlier_s) / (later - earlier)
            for (earlier, earlier_s), (later, later_s) in zip(
                self._moments, self._moments[stretch:], strict=False
            )
            if later > earlier
        )

    def _take(self, delivery: Delivery | None) -> bool:
        if delivery is None:
            raise CameraStalled(f"the camera sent no frame within {START_S:.0f} s")
        age_s = self.stream.now_s() - delivery.timestamp_s
        if not _LEAST_AGE_S <= age_s < _MOST_AGE_S:
            raise InputError(
                f"frames are stamped {age_s:.3g} s before they come, so by another clock than "
                "CLOCK_MONOTONIC; for USB cameras, load uvcvideo with clock=CLOCK_MONOTONIC"
            )
        if delivery.is_damaged or not delivery.data:
            self._damage = "the driver says that data are missing"
            return False
        try:
            self.levels.append(self._level_of(delivery.data))
        except UnreadableFrame as error:
            self._damage = str(error)
            return False
        self.recent.append(delivery)
        self._moments.append((delivery.sequence, delivery.timestamp_s))
        return True


def _step(
    frames: _FrameLog,
    interval_s: float,
    set_exposure: SetExposure,
    time_s: float,
    old: float,
    new: float,
) -> _Step:
    """Set an exposure, and read until two frames running have its level."""
    begun_s = frames.stream.now_s()
    set_exposure(time_s)
    done_s = frames.stream.now_s()
    last_old_s = last_unsettled_s = frames.recent[-1].timestamp_s
    first_changed_s = first_new_s = None
    for _ in range(_MOST_FRAMES):
        frames.read()
        stamp_s = earliest_stamp(frames.recent, interval_s)
        share = (frames.levels[-1] - old) / (new - old)
        if share < _OLD:
            last_old_s, first_changed_s = stamp_s, None
        elif first_changed_s is None:
            first_changed_s = stamp_s
        if share < _NEW:
            last_unsettled_s, first_new_s = stamp_s, None
        elif first_new_s is None:
            first_new_s = stamp_s
        elif first_changed_s is not None:
            return _Step(
                begun_s, done_s, last_old_s, first_changed_s, last_unsettled_s, first_new_s
            )
    raise InputError(
        f"an exposure of {time_s:.2g} s did not show within {_MOST_FRAMES} frames; the camera does "
        "not follow its exposure control"
    )


def _bounds(steps: list[_Step], interval_s: float) -> Settling:
    """Return what the steps leave possible for the delay.

    A step tells that its delay is above one number and at most another. If one delay explains all
    steps, it lies between the largest of the former and the smallest of the latter. If it hardly
    does, it varies at least between these two; if it does not, any delay of any step is possible.

    At which moment between `begun` and `done` a setting counts is not known: the earliest delay is
    measured from done and the latest from begun, to be applied the other way round.
    """
    earliest_s, _ = _range(
        [step.last_old_s - step.done_s for step in steps],
        [step.first_changed_s - step.done_s for step in steps],
        interval_s,
    )
    _, latest_s = _range(
        [step.last_unsettled_s - step.begun_s for step in steps],
        [step.first_new_s - step.begun_s for step in steps],
        interval_s,
    )
    guard_s = _GUARD * interval_s
    return Settling(
        earliest_s=max(earliest_s - guard_s, 0.0),
        latest_s=latest_s + guard_s,
        setting_s=median(step.done_s - step.begun_s for step in steps),
        frame_interval_s=interval_s,
    )


def _range(
    more_than_s: list[float], at_most_s: list[float], interval_s: float
) -> tuple[float, float]:
    """Return where a delay lies that is above one and up to another number in each step."""
    above_s, up_to_s = max(more_than_s), min(at_most_s)
    if above_s - up_to_s > _WANDER * interval_s:
        return min(more_than_s), max(at_most_s)
    return min(above_s, up_to_s), max(above_s, up_to_s)
