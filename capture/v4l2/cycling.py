"""Cycles a camera through exposures at its highest rate, and tells which exposure a frame has.

Domain : cameras that follow as `capture.v4l2.settling` describes; exposures within a frame.
Input  : a running stream.    Output : frames whose exposure is certain.
Cost   : a frame for each exposure, if the delay is steady and settings take less than a fifth of a
         frame: four times as many brackets as by waiting for each exposure to show.
Fails  : where the delay varies by more than was measured; see
         tests/limits/test_camera_wandering_delay.py.

Settings are sent ahead, one for each frame where the camera's delay is steady enough, at the moment
that leaves the frame they are meant for furthest from doubt. Which exposure a frame has is then
told by its timestamp alone, never by counting; a frame that could have either of two is skipped.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, NamedTuple

from numpy.typing import NDArray

from capture.errors import CameraStalled, UnreadableFrame
from capture.v4l2.settling import RECENT, SetExposure, Settling, earliest_stamp
from capture.v4l2.stream import Delivery, FrameStream

_STALE = 3.0
"""Frame intervals after which a frame that waited is stale: it takes one to be sent, and up to one
more passes before it is asked for."""

_LEAST_MARGIN = 0.15
"""Frame intervals of certainty to keep on either side of a frame, for settings that come late."""

_STALL_INTERVALS, _STALL_S = 20, 2.0
_PATIENCE = 10  # frames that a setting may take, beyond all delays
_LOG = 64  # settings kept; far more than are on their way


@dataclass
class CameraCounters:
    """What became of the frames that the camera sent.

    frames = used + skipped_settling + surplus + errors + stale.

    Attributes
    ----------
    skipped_settling : int
        On the way from one exposure to another, or stamped so late that it may be.
    surplus : int
        Of a known exposure that was not wanted again.
    errors : int
        Damaged, by the driver's mark or because they cannot be read.
    stale : int
        Waited while nobody read.
    gaps : int
        Frames that never came, by the driver's count.
    contradictions : int
        Brackets whose pixels contradicted their exposures; their frames count as used.
    """

    frames: int = 0
    used: int = 0
    skipped_settling: int = 0
    surplus: int = 0
    errors: int = 0
    stale: int = 0
    gaps: int = 0
    contradictions: int = 0


class Exposed(NamedTuple):
    """A frame, the exposure that it certainly has, and what it looks like.

    `wanted_s` is as asked for, `actual_s` as the camera read it back; `samples` are in DN.
    """

    delivery: Delivery
    wanted_s: float
    actual_s: float
    samples: NDArray[Any]


class _Setting(NamedTuple):
    """An exposure, and between which stamps the first frame lies that has it."""

    wanted_s: float
    actual_s: float
    earliest_s: float
    latest_s: float


class ExposureCycle:
    """Sets exposures ahead of the frames that are to have them.

    `look` returns samples of a frame's pixels, or raises UnreadableFrame; `counters` are added to.
    """

    def __init__(
        self,
        stream: FrameStream,
        set_exposure: SetExposure,
        look: Callable[[bytes], NDArray[Any]],
        settling: Settling,
        counters: CameraCounters,
    ) -> None:
        self._stream = stream
        self._set_exposure = set_exposure
        self._look = look
        self._settling = settling
        self._counters = counters
        self._settings: deque[_Setting] = deque(maxlen=_LOG)
        self._recent: deque[Delivery] = deque(maxlen=RECENT)
        self._aimed_s = 0.0  # the frame that the last setting was meant for
        interval_s = settling.frame_interval_s
        self._stride = ceil(settling.doubt_s / interval_s + 2 * _LEAST_MARGIN)
        """Frames from one setting to the next."""
        self._margin_s = (self._stride * interval_s - settling.doubt_s) / 2
        self._lead_s = settling.latest_s + settling.setting_s + self._margin_s

    def collect(self, times_s: Sequence[float]) -> list[Exposed]:
        """Return a frame of each exposure time, in the order in which they came.

        The same times are expected to be asked for next, and are set already.

        Raises
        ------
        UnreadableFrame
            If frames come, but not with these exposures.
        CameraStalled
            If no frame comes.
        CameraLost
            If the camera is gone.
        """
        fresh_s = self._stream.now_s() - _STALE * self._settling.frame_interval_s
        missing = list(times_s)
        collected: list[Exposed] = []
        patience = _PATIENCE * (1 + len(missing)) * self._stride
        while missing:
            delivery = self._next(missing, list(times_s))
            exposed = self._judge(delivery, fresh_s, missing)
            if exposed is not None:
                missing.remove(exposed.wanted_s)
                collected.append(exposed)
            elif delivery.timestamp_s >= fresh_s:
                patience -= 1
            if patience < 0:
                raise UnreadableFrame(
                    f"exposures of {', '.join(f'{time_s:.3g}' for time_s in missing)} s do not "
                    "show in the frames; the camera's frame rate may have changed"
                )
        return collected

    def _next(self, missing: list[float], times_s: list[float]) -> Delivery:
        """Return the next frame, setting what is due while waiting for it."""
        deadline_s = self._stream.now_s() + max(
            _STALL_S, _STALL_INTERVALS * self._settling.frame_interval_s
        )
        while True:
            aim_s = self._next_aim()
            due_s = deadline_s if aim_s is None else aim_s - self._lead_s
            delivery = self._stream.next_frame(min(due_s, deadline_s) - self._stream.now_s())
            if delivery is not None:
                return delivery
            now_s = self._stream.now_s()
            if now_s >= deadline_s:
                raise CameraStalled("the camera has stopped sending frames")
            if aim_s is not None and now_s >= due_s:
                self._set(self._choose(aim_s, missing, times_s))
                self._aimed_s = aim_s

    def _next_aim(self) -> float | None:
        """Return the stamp of the next frame that a setting can be meant for; None if unknown."""
        if not self._settings:
            return self._stream.now_s() + self._lead_s
        interval_s = self._settling.frame_interval_s
        now_s = self._stream.now_s()
        if not self._recent or now_s - self._recent[-1].timestamp_s > _STALE * interval_s:
            return None  # when frames come is seen from the next one
        last_s = earliest_stamp(self._recent, interval_s)
        after_aimed_s = self._aimed_s + (self._stride - 0.5) * interval_s
        earliest_s = max(now_s - self._margin_s / 2 + self._lead_s, after_aimed_s)
        return last_s + interval_s * max(ceil((earliest_s - last_s) / interval_s), 1)

    def _choose(self, aim_s: float, missing: list[float], times_s: list[float]) -> float:
        """Return what to expose the frame at `aim_s` by: the first that no frame before it has."""
        interval_s = self._settling.frame_interval_s
        stamp_s = aim_s
        if self._recent:
            stamp_s = earliest_stamp(self._recent, interval_s) + interval_s
        ahead = ceil((aim_s - stamp_s) / interval_s)
        wanted = [*missing, *times_s * (1 + ahead // len(times_s))]
        while stamp_s < aim_s - interval_s / 2:
            setting = self._setting_at(stamp_s)
            if setting is not None and setting.wanted_s in wanted:
                wanted.remove(setting.wanted_s)
            stamp_s += interval_s
        return wanted[0]

    def _set(self, wanted_s: float) -> None:
        if self._settings and self._settings[-1].wanted_s == wanted_s:
            return
        begun_s = self._stream.now_s()
        actual_s = self._set_exposure(wanted_s)
        done_s = self._stream.now_s()
        earliest_s = begun_s + self._settling.earliest_s
        latest_s = done_s + self._settling.latest_s
        self._settings.append(_Setting(wanted_s, actual_s, earliest_s, latest_s))

    def _setting_at(self, stamp_s: float) -> _Setting | None:
        """Return the setting that a frame of this stamp certainly has; None if it is in doubt."""
        for setting in reversed(self._settings):
            if setting.latest_s <= stamp_s:
                return setting
            if setting.earliest_s <= stamp_s:
                return None
        return None

    def _judge(
        self, delivery: Delivery, fresh_s: float, missing: Sequence[float]
    ) -> Exposed | None:
        """Return the frame with its exposure if it is one of those missing; else None. Counts."""
        self._counters.frames += 1
        if self._recent:
            self._counters.gaps += max(delivery.sequence - self._recent[-1].sequence - 1, 0)
        self._recent.append(delivery)
        if delivery.timestamp_s < fresh_s:
            self._counters.stale += 1
            return None
        if delivery.is_damaged or not delivery.data:
            self._counters.errors += 1
            return None
        setting = self._setting_at(delivery.timestamp_s)
        earliest_s = earliest_stamp(self._recent, self._settling.frame_interval_s)
        if setting is None or setting is not self._setting_at(earliest_s):
            self._counters.skipped_settling += 1
            return None
        if setting.wanted_s not in missing:
            self._counters.surplus += 1
            return None
        try:
            samples = self._look(delivery.data)
        except UnreadableFrame:
            self._counters.errors += 1
            return None
        self._counters.used += 1
        return Exposed(delivery, setting.wanted_s, setting.actual_s, samples)
