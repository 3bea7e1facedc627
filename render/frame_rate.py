"""Holding a frame rate: first fewer lights, then a smaller picture, and back again.

The lights go down to a few (lighting/stream/budget.py). If that is not enough, the picture becomes
smaller, in steps of a sixth of its width, and is enlarged to be shown. It grows again once all
lights fit. Where a picture of p pixels takes a + b p milliseconds, a and b at least 0, one that has
grown always fits, because a is taken to grow with p: so what shrinks only shrinks until it fits,
and nothing oscillates. Timings that scatter are judged by their median.

Input  : what each frame took in each stage.    Output : what the next one may take.
Fails  : where all but lights and picture takes too long, the rate is not held; the picture is then
         left a quarter of the time.
         Of a load that comes and goes within a few dozen frames, each change is followed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import median

from capture.errors import InputError
from lighting.stream.light_stream import LightPlan, StreamMemory

FEWEST_LIGHTS = 16
"""Before the picture becomes smaller."""
STEPS = 8
"""Most steps of a picture: then it is a quarter as wide and as high."""
FRAMES = 12
"""Frames whose times are judged together."""

_FEWEST_FRAMES = 3
_STEP = 2.0**-0.25
"""Width of a picture over that of the one before it: four steps halve it."""
_MOST_STEPS = 2
_MOST_USE, _MOST_USE_OF_FEW_FRAMES = 1.0, 1.3
_AIM = 0.9
_LEAST_BUDGET_MS = 0.1
_LEAST_SHARE = 0.25
"""Of a frame's time, which a picture may take however long the rest does: there, less of it would
change little."""
_BEFORE = ("merge", "remap", "blocks")
"""Stages of a frame before its lights. Decoding and writing have threads of their own."""


@dataclass(frozen=True)
class Pace:
    """What a frame may take, and what frames took since that last changed.

    Attributes
    ----------
    step : int
        The picture is 2^(−step / 4) as wide and as high as is asked for.
    most_lights : int
    took_ms : tuple of (float, float)
        Milliseconds of the picture, and of all else, of each frame.
    """

    step: int = 0
    most_lights: int = 0
    took_ms: tuple[tuple[float, float], ...] = ()


def next_pace(
    pace: Pace,
    most_lights: int,
    took_ms: tuple[float, float],
    period_ms: float,
    *,
    are_fewest: bool,
    are_all: bool,
) -> Pace:
    """Return the pace of the next frame.

    Parameters
    ----------
    pace : Pace
    most_lights : int
        That there was time for in the last frame.
    took_ms : (float, float)
        Milliseconds of its picture, and of all else.
    period_ms : float
        That all of it may take.
    are_fewest, are_all : bool
        Whether there cannot be fewer lights, and whether no more are wanted.
    """
    before = pace.took_ms if most_lights == pace.most_lights else ()
    times_ms = (*before, took_ms)[-FRAMES:]
    step = pace.step
    if len(times_ms) >= _FEWEST_FRAMES:
        picture_ms = median(picture for picture, _ in times_ms)
        other_ms = median(other for _, other in times_ms)
        is_settled = len(times_ms) == FRAMES
        most_use = _MOST_USE if is_settled else _MOST_USE_OF_FEW_FRAMES
        is_over = picture_ms + other_ms > most_use * period_ms
        if is_over and are_fewest and picture_ms > _LEAST_SHARE * period_ms:
            wanted_ms = max(_AIM * period_ms - other_ms, _LEAST_SHARE * period_ms)
            step = min(step + _steps_down(picture_ms / wanted_ms), STEPS)
        elif is_settled and are_all and picture_ms / _STEP**2 + other_ms < _AIM * period_ms:
            step = max(step - 1, 0)
    return Pace(step, most_lights, times_ms if step == pace.step else ())


def _steps_down(excess: float) -> int:
    """Return the steps after which a picture takes so many times less, at least 1."""
    steps = math.ceil(-math.log(max(excess, 1.0)) / (2 * math.log(_STEP)))
    return min(max(steps, 1), _MOST_STEPS)


class FrameRate:
    """The frame rate that a session holds.

    Parameters
    ----------
    rate_hz : float or None
        None takes the time it takes.

    Raises
    ------
    InputError
        If it is not a positive number.
    """

    def __init__(self, rate_hz: float | None) -> None:
        if rate_hz is not None and not 0 < rate_hz < math.inf:
            raise InputError(f"a frame rate must be a number above 0, got {rate_hz:g}")
        self._rate_hz = rate_hz
        self._pace = Pace()
        self._before_ms: tuple[float, ...] = ()

    @property
    def rate_hz(self) -> float | None:
        """The rate; with another one all begins anew."""
        return self._rate_hz

    def planned(self, plan: LightPlan) -> LightPlan:
        """Return the plan with the time that there is for the lights and picture of a frame."""
        if self._rate_hz is None:
            return plan
        before_ms = median(self._before_ms) if self._before_ms else 0.0
        budget_ms = max(1e3 / self._rate_hz - before_ms, _LEAST_BUDGET_MS)
        return replace(plan, budget_ms=budget_ms, fewest=min(FEWEST_LIGHTS, plan.count))

    def note(self, frame_ms: Mapping[str, float]) -> None:
        """Take note of what a frame took before its lights."""
        before_ms = sum(frame_ms.get(stage, 0.0) for stage in _BEFORE)
        self._before_ms = (*self._before_ms, before_ms)[-FRAMES:]

    def judge(self, frame_ms: Mapping[str, float], plan: LightPlan, memory: StreamMemory) -> None:
        """Take note of what a frame of a planned plan, drawn in `size_px`, took in each stage."""
        self.note(frame_ms)
        if self._rate_hz is None:
            return
        self._pace = next_pace(
            self._pace,
            memory.most,
            (frame_ms["render"], self._before_ms[-1] + frame_ms["lights"]),
            1e3 / self._rate_hz,
            are_fewest=memory.most <= plan.fewest,
            are_all=memory.most == plan.count or memory.found < memory.most,
        )

    def size_px(self, full_px: tuple[int, int]) -> tuple[int, int]:
        """Return the (width, height) of the next picture, at most that of one that is whole."""
        scale = _STEP**self._pace.step
        width, height = (max(round(scale * length), 1) for length in full_px)
        return width, height
