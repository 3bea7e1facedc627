"""The lights of one frame after the other: remembered, steady, no more than there is time for.

Input  : what the camera sees at each moment, as a map or as block sums, all of one size.
Output : LightSets, each with the timestamp of its moment.
Frames may be missing: the next one follows the last that came, by the time that has passed.
Fails  : with a time budget the lights depend on how fast the machine was; without one, the same
         frames give the same lights, bit for bit.
"""

from dataclasses import dataclass

from capture.errors import InputError
from lighting.blocks.block_sums import BlockSums
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.methods import adaptive
from lighting.reduce import ADAPTIVE, check_request, most_block_rows, reduce_next
from lighting.stream import temporal
from lighting.stream.budget import FIRST_COUNT, FRAMES, next_count


@dataclass(frozen=True)
class LightPlan:
    """What lights every frame is to have.

    Attributes
    ----------
    count : int
        Number of lights; with `error` the most there may be.
    method : str
        A key of `reduce.METHODS`.
    error : float or None
        Relative error behind occluders that is to be met with as few lights as will do.
    budget_ms : float or None
        Milliseconds that lights and picture may take: `count` or `error` is then not met where more
        lights would be needed than there is time for. Changing their number moves no light but
        those that are cut in two or put together.
    fewest : int
        Lights for which there always is time.
    is_steady : bool
        Whether what trembles is smoothed (temporal.py).
    """

    count: int = 64
    method: str = ADAPTIVE
    error: float | None = None
    budget_ms: float | None = None
    fewest: int = 1
    is_steady: bool = True

    def __post_init__(self) -> None:
        check_request(self.count, self.method, self.error)
        if self.budget_ms is not None and not 0 < self.budget_ms < float("inf"):
            raise InputError(f"a budget must be above 0 ms, got {self.budget_ms:g}")

    @property
    def block_rows(self) -> int:
        """Rows of blocks, beyond which sums over them make no difference to the lights."""
        return most_block_rows(self.count, self.method, self.error)


@dataclass(frozen=True, eq=False)
class StreamMemory:
    """What one frame leaves to the next.

    Attributes
    ----------
    reduced : adaptive.Memory or None
    shown : temporal.Memory or None
    most : int
        Lights that there was time for.
    found : int
        Lights that the map was reduced to.
    took_ms : tuple of float
        What frames took since `most` changed.
    """

    reduced: adaptive.Memory | None
    shown: temporal.Memory | None
    most: int
    found: int
    took_ms: tuple[float, ...] = ()


def next_lights(
    view: EnvironmentMap | BlockSums,
    plan: LightPlan,
    memory: StreamMemory | None = None,
    *,
    took_ms: float | None = None,
    timestamp_s: float = 0.0,
    source: str = "",
) -> tuple[LightSet, StreamMemory]:
    """Return the lights to show for the next frame, and what to remember of it.

    Parameters
    ----------
    view : EnvironmentMap or BlockSums
    plan : LightPlan
        The same for every frame, but for its budget.
    memory : StreamMemory or None
        That of the last frame; None for the first.
    took_ms : float or None
        Milliseconds that lights and picture of the last frame took, for the budget.
    timestamp_s : float
        Moment of the frame.
    source : str
        What the frame is, for people.

    Raises
    ------
    InputError
        As `reduce_next` and `temporal.steady`.
    """
    most, times_ms = _time_for(plan, memory, took_ms)
    lights, reduced = reduce_next(
        view,
        most,
        plan.method,
        memory.reduced if memory else None,
        error=plan.error,
        timestamp_s=timestamp_s,
        source=source,
    )
    found, shown = len(lights), None
    if plan.is_steady:
        lights, shown = temporal.steady(lights, memory.shown if memory else None)
    return lights, StreamMemory(reduced, shown, most, found, times_ms)


def _time_for(
    plan: LightPlan, memory: StreamMemory | None, took_ms: float | None
) -> tuple[int, tuple[float, ...]]:
    """Return the most lights there is time for, and the frames' times since that last changed."""
    if plan.budget_ms is None:
        return plan.count, ()
    if memory is None:
        return min(FIRST_COUNT, plan.count), ()
    times_ms = memory.took_ms
    if took_ms is not None:
        times_ms = (*times_ms, took_ms)[-FRAMES:]
    following = next_count(memory.most, memory.found, times_ms, plan.budget_ms, plan.fewest)
    most = min(following, plan.count)
    return most, times_ms if most == memory.most else ()
