"""The session: brackets come in on one thread, pictures are made on another, nothing is lost.

One producer thread owns the source and decodes; the calling thread owns the OpenGL context and
every numba kernel (numba's default thread pool must not be entered from two threads at once). A
bounded queue joins them. Every bracket ends in exactly one counter.

Input  : an iterable of Bracket, or of UnreadableFrame for a bracket that could not be read.
Output : Counters and per-frame stage times; what is done with a bracket is the caller's `process`.
Fails  : a source that blocks forever blocks the session too; the source owns its time limits.
"""

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, field
from enum import Enum

from capture.errors import UnreadableFrame
from capture.frame import Bracket, FrameSource

QUEUE_LENGTH = 1
"""Brackets that may wait: with the one that is being decoded, enough to overlap that with the rest;
each one more adds a frame to the latency."""


END_TO_END = "end to end"


class Policy(Enum):
    """What happens to a bracket that arrives while the queue is full."""

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
        """Add time measured elsewhere (the producer's decoding) to the current frame."""
        self.frames[-1][name] = self.frames[-1].get(name, 0.0) + milliseconds


@dataclass(frozen=True)
class _Delivery:
    bracket: Bracket | UnreadableFrame
    start_s: float
    decode_ms: float


def run_session(
    source: FrameSource,
    process: Callable[[Bracket, StageClock, Counters], None],
    *,
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
        Called on this thread with the bracket, the clock whose current frame is this bracket's,
        and the counters so far, of which it counts `merged` and `rendered`.
    policy : Policy
        EVERY blocks the producer while the queue is full (replay: deterministic); NEWEST drops the
        oldest waiting bracket (live).
    on_failure : callable
        Told of each bracket that could not be read.
    clock : StageClock or None
        One to go on with; a new one if not given.

    Raises
    ------
    Exception
        Whatever `source` or `process` raised; the producer thread has ended by then.
    """
    counters, clock = Counters(), clock or StageClock()
    producer = _Producer(source, policy)
    producer.start()
    try:
        for delivery in producer.deliveries():
            counters.captured, counters.replaced = producer.captured, producer.replaced
            if isinstance(delivery.bracket, UnreadableFrame):
                counters.failed += 1
                on_failure(delivery.bracket)
                continue
            clock.begin_frame()
            clock.add("decode", delivery.decode_ms)
            process(delivery.bracket, clock, counters)
            clock.add(END_TO_END, 1e3 * (time.perf_counter() - delivery.start_s))
    finally:
        producer.stop()
        counters.captured, counters.replaced = producer.captured, producer.replaced
    return counters, clock


class _Producer(threading.Thread):
    """Iterates the source and fills the queue until the end, an exception or `stop`."""

    def __init__(self, source: FrameSource, policy: Policy) -> None:
        super().__init__(name="fishlight-producer", daemon=True)
        self.captured = 0
        self.replaced = 0
        self._source = source
        self._policy = policy
        self._queue: queue.Queue[_Delivery | None] = queue.Queue(
            1 if policy is Policy.NEWEST else QUEUE_LENGTH
        )
        self._stopped = threading.Event()
        self._error: BaseException | None = None

    def run(self) -> None:
        try:
            iterator = iter(self._source)
            while not self._stopped.is_set():
                start_s = time.perf_counter()
                bracket = next(iterator, None)
                if bracket is None:
                    break
                decode_ms = 1e3 * (time.perf_counter() - start_s)
                if self._put(_Delivery(bracket, start_s, decode_ms)):
                    self.captured += 1
        except BaseException as error:  # handed to the consumer, which raises it
            self._error = error
        finally:
            self._put(None)

    def deliveries(self) -> Iterator[_Delivery]:
        while (delivery := self._queue.get()) is not None:
            yield delivery
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """End the thread, whatever it waits for in the queue, and join it."""
        self._stopped.set()
        while self.is_alive():
            self._drain_one()
            self.join(timeout=0.05)

    def _put(self, delivery: _Delivery | None) -> bool:
        """Queue a delivery by the policy; False if the session stopped meanwhile."""
        # The end mark displaces nothing: it waits for its place.
        newest_wins = self._policy is Policy.NEWEST and delivery is not None
        while not self._stopped.is_set():
            try:
                self._queue.put(delivery, block=not newest_wins, timeout=0.05)
                return True
            except queue.Full:
                if newest_wins and self._drain_one():
                    self.replaced += 1
        return False

    def _drain_one(self) -> bool:
        try:
            return self._queue.get_nowait() is not None
        except queue.Empty:
            return False
