"""The session: brackets come in on one thread, pictures are made on another, nothing is lost.

One producer thread owns the source, decodes, and prepares brackets if it is asked to; the calling
thread owns the OpenGL context and every parallel numba kernel (numba's default thread pool must not
be entered from two threads at once). Every bracket ends in exactly one counter.

A source that is as fast as it is asked, a recording, is asked for the next bracket when the one
before it is taken: decoding and the rest overlap, and no bracket lies waiting for longer than one
takes. With a queue between them each place in it would add that to the latency. What the producer
prepares fills the core that the rest, of which a third runs on one core, leaves free.

Input  : an iterable of Bracket, or of UnreadableFrame for a bracket that could not be read.
Output : Counters and per-frame stage times; what is done with a bracket is the caller's `process`.
Fails  : a source that blocks forever blocks the session too; the source owns its time limits.
"""

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import astuple, dataclass, field
from enum import Enum
from typing import Any, TypeVar, overload

from capture.errors import UnreadableFrame
from capture.frame import Bracket, FrameSource

END_TO_END = "end to end"

Prepared = TypeVar("Prepared")


class Policy(Enum):
    """What happens to a bracket that arrives while another one waits."""

    EVERY = "every bracket in order"
    NEWEST = "the newest bracket wins"


@dataclass
class Counters:
    """Where the brackets of a session went: captured = replaced + failed + rendered.

    Attributes
    ----------
    captured : int
        Brackets that the source delivered, unreadable ones included.
    replaced : int
        Brackets that a newer one displaced before they were looked at.
    failed : int
        Brackets that could not be read.
    merged, rendered : int
        Brackets that passed the merge, and that became a picture.
    """

    captured: int = 0
    replaced: int = 0
    merged: int = 0
    rendered: int = 0
    failed: int = 0

    def __add__(self, other: "Counters") -> "Counters":
        """Return what two sessions counted together."""
        return Counters(
            *(one + another for one, another in zip(astuple(self), astuple(other), strict=True))
        )


@dataclass
class StageClock:
    """Milliseconds that each frame spent in each stage, and in all from end to end.

    `frames` holds one {stage: ms} per processed bracket, in order; a session without an end gives
    it a length. END_TO_END begins when the bracket's capture does and includes what it waited.
    """

    frames: deque[dict[str, float]] = field(default_factory=deque)

    def begin_frame(self) -> None:
        """Start the record of the next frame."""
        self.frames.append({})

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the duration of the block to stage `name` of the current frame."""
        start_s = time.perf_counter()
        try:
            yield
        finally:
            elapsed_ms = 1e3 * (time.perf_counter() - start_s)
            frame = self.frames[-1]
            frame[name] = frame.get(name, 0.0) + elapsed_ms

    def add(self, name: str, milliseconds: float) -> None:
        """Add time measured elsewhere (by the producer) to the current frame."""
        self.frames[-1][name] = self.frames[-1].get(name, 0.0) + milliseconds


@dataclass(frozen=True)
class _Delivery:
    content: Any
    start_s: float
    stages_ms: dict[str, float]


@overload
def run_session(
    source: FrameSource,
    process: Callable[[Bracket, StageClock, Counters], None],
    *,
    policy: Policy = ...,
    on_failure: Callable[[UnreadableFrame], None] = ...,
    clock: StageClock | None = ...,
) -> tuple[Counters, StageClock]: ...


@overload
def run_session(
    source: FrameSource,
    process: Callable[[Prepared, StageClock, Counters], None],
    *,
    prepare: Callable[[Bracket, StageClock], Prepared],
    policy: Policy = ...,
    on_failure: Callable[[UnreadableFrame], None] = ...,
    clock: StageClock | None = ...,
) -> tuple[Counters, StageClock]: ...


def run_session(
    source: FrameSource,
    process: Callable[[Any, StageClock, Counters], None],
    *,
    prepare: Callable[[Bracket, StageClock], Any] | None = None,
    policy: Policy = Policy.EVERY,
    on_failure: Callable[[UnreadableFrame], None] = lambda _error: None,
    clock: StageClock | None = None,
) -> tuple[Counters, StageClock]:
    """Take every bracket of `source` through `process` and account for it.

    Parameters
    ----------
    source : FrameSource
        Iterated on the producer thread.
    process : callable
        Called on this thread with the bracket, or what `prepare` made of it, the clock whose
        current frame is this bracket's, and the counters so far, of which it counts `merged` and
        `rendered`.
    prepare : callable or None
        Called on the producer thread with the bracket and a clock whose current frame is this
        bracket's. It must enter no parallel kernel.
    policy : Policy
        EVERY asks the source for a bracket when the one before it is taken (replay:
        deterministic); NEWEST takes what comes and drops what still waits (live).
    on_failure : callable
        Told of each bracket that could not be read.
    clock : StageClock or None
        One to go on with; a new one if not given.

    Raises
    ------
    Exception
        Whatever `source`, `prepare` or `process` raised; the producer thread has ended by then.
    """
    counters, clock = Counters(), clock or StageClock()
    producer = _Producer(source, prepare, policy)
    producer.start()
    try:
        for delivery in producer.deliveries():
            counters.captured, counters.replaced = producer.captured, producer.replaced
            if isinstance(delivery.content, UnreadableFrame):
                counters.failed += 1
                on_failure(delivery.content)
                continue
            clock.begin_frame()
            for stage, elapsed_ms in delivery.stages_ms.items():
                clock.add(stage, elapsed_ms)
            process(delivery.content, clock, counters)
            clock.add(END_TO_END, 1e3 * (time.perf_counter() - delivery.start_s))
    finally:
        producer.stop()
        counters.captured, counters.replaced = producer.captured, producer.replaced
    return counters, clock


class _Producer(threading.Thread):
    """Iterates the source until its end, an exception or `stop`; at most one bracket waits."""

    def __init__(
        self,
        source: FrameSource,
        prepare: Callable[[Bracket, StageClock], Any] | None,
        policy: Policy,
    ) -> None:
        super().__init__(name="fishlight-producer", daemon=True)
        self.captured = 0
        self.replaced = 0
        self._source = source
        self._prepare = prepare
        self._policy = policy
        self._waiting: queue.SimpleQueue[_Delivery | None] = queue.SimpleQueue()
        self._wanted = threading.Semaphore(1)
        self._is_stopped = False
        self._error: BaseException | None = None

    def run(self) -> None:
        try:
            self._deliver()
        except BaseException as error:  # handed to the consumer, which raises it
            self._error = error
        finally:
            self._waiting.put(None)

    def deliveries(self) -> Iterator[_Delivery]:
        while (delivery := self._waiting.get()) is not None:
            self._wanted.release()
            yield delivery
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """End the thread once its source has answered, and join it."""
        self._is_stopped = True
        self._wanted.release()
        self.join()

    def _deliver(self) -> None:
        iterator = iter(self._source)
        clock = StageClock(deque(maxlen=1))
        while True:
            if self._policy is Policy.EVERY:
                self._wanted.acquire()
            if self._is_stopped:
                return
            clock.begin_frame()
            start_s = time.perf_counter()
            with clock.stage("decode"):
                bracket = next(iterator, None)
            if bracket is None or self._is_stopped:
                return
            content: Any = bracket
            if self._prepare is not None and not isinstance(bracket, UnreadableFrame):
                content = self._prepare(bracket, clock)
            if self._policy is Policy.NEWEST:
                self._drop_waiting()
            self.captured += 1
            self._waiting.put(_Delivery(content, start_s, clock.frames[-1]))

    def _drop_waiting(self) -> None:
        with suppress(queue.Empty):
            self._waiting.get_nowait()
            self.replaced += 1
