"""Runs dealt out to the workers of a dask cluster, and followed until all that they leave is there.

Three tasks for each run (steps.py): prepare, light, preview. Tasks of the first kind are long and
are dealt to each worker as it gets free; dask sends the others to where the prepared frames lie.
What goes through the client is a run's record and the place of a file, and the lights if there is
to be a preview: nothing that is as large as a picture.

A run whose worker is gone is dealt out again: the client looks who is there, since dask would wait
for that worker to come back.

The client holds a few runs for each worker, whatever there is to do in all. It alone knows in which
order lights follow, and dask no more than three tasks of each run in flight: a chain of tasks that
depend on one another would be worked off from its beginning whenever a worker is lost.

Input  : sequences (sequence.py).    Output : calls of `on_concluded` and `on_failed`.
Cost   : for the client about 3 ms a run.
Fails  : the scheduler must live; where it does not, what is done is on disk, and the batch can be
         started again.
"""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Protocol
from uuid import uuid4

from distributed import CancelledError, Client, Future, KilledWorker
from distributed.comm.core import CommClosedError

from capture.errors import FishlightError
from render.batch.attempts import MOST_ATTEMPTS
from render.batch.frames import LitRun, RunRecord
from render.batch.runs import Job, Run
from render.batch.steps import Steps, seceded, with_share_of_threads
from render.batch.workers import Workers

_RUNS_PER_THREAD = 3
"""Runs in flight: one being prepared, one whose lights are found, one that waits for its turn."""
_LIGHT_FIRST, _PREVIEW_NEXT = 2, 1
_MOST_WAIT_S = 2.0
"""Before it is asked again whether a run's worker is gone."""
_MOST_LOSSES = 2
"""Workers that may be lost with a run, beside those that its frames are known to have ended."""
_DEPTH = 4
"""Runs of one recording in flight before another recording is begun."""
_MOST_OPEN = 32
"""Recordings at a time: the client holds the list of frames of each."""


class FrameSequence(Protocol):
    """Runs of which each has to know what the one before came to, as RecordingSequence."""

    job: Job
    link: str
    before: Path | None
    in_flight: int

    @property
    def is_finished(self) -> bool:
        """Whether every run is concluded."""

    def next_run(self) -> Run | None:
        """Return the next run to prepare; None if there is none, or none yet."""

    def conclude(self, run: Run, record: RunRecord) -> None:
        """Go on from the record of the earliest run that is in flight."""


_STEPS = Steps()


@dataclass(eq=False)
class _RunInFlight:
    """A run, the worker it was dealt to, and the one task that is awaited for it."""

    queue: "_Queue"
    run: Run
    worker: str
    losses: int = 0
    awaited: str = ""
    prepared: Future[Any] | None = None
    is_prepared: bool = False
    follows: tuple[str, Path | None] | None = None
    lit: Future[Any] | None = None
    preview: Future[Any] | None = None
    record: RunRecord | None = None


@dataclass(eq=False)
class _Queue:
    """A sequence and its runs in flight whose lights are not known, in order."""

    sequence: FrameSequence
    runs: deque[_RunInFlight] = field(default_factory=deque)
    has_failed: bool = False


class Tracker:
    """Takes sequences of runs through a cluster.

    Parameters
    ----------
    client : Client
    on_concluded : callable
        Told of the record of each run when all its files are there.
    on_failed : callable
        Told of a sequence that cannot go on, and why. The others do.
    on_no_workers : callable
        Told each time that there come to be no workers; it waits for one.
    steps : Steps
        What is done with each run.
    """

    def __init__(
        self,
        client: Client,
        on_concluded: Callable[[RunRecord], None],
        on_failed: Callable[[FrameSequence, BaseException], None],
        on_no_workers: Callable[[], None] = lambda: None,
        steps: Steps = _STEPS,
    ) -> None:
        self._client = client
        self._on_concluded = on_concluded
        self._on_failed = on_failed
        self._steps = steps
        self._queues: list[_Queue] = []
        self._in_flight: dict[_RunInFlight, None] = {}
        self._lost: deque[_RunInFlight] = deque()
        self._done: SimpleQueue[tuple[_RunInFlight, Future[Any]]] = SimpleQueue()
        self._workers = Workers(client, on_no_workers)
        self._name = f"fishlight-{uuid4().hex[:8]}"
        self._numbers = count()

    def run_all(self, sequences: Iterator[FrameSequence]) -> None:
        """Work until every sequence is finished or has failed.

        Raises
        ------
        FishlightError
            If the scheduler is lost.
        """
        try:
            while True:
                self._look()
                self._deal_out(sequences)
                if not self._in_flight:
                    return
                with suppress(Empty):
                    run, future = self._done.get(timeout=_MOST_WAIT_S)
                    if future.key == run.awaited:
                        self._go_on(run, future)
        except (CommClosedError, CancelledError) as error:
            raise FishlightError(
                f"the scheduler is gone ({error}); what is done is kept, and the batch can be "
                "started again to go on"
            ) from None

    def _look(self) -> None:
        """Find out from time to time which workers there are, and which runs were with others."""
        try:
            if not self._workers.look(is_to_wait=not self._in_flight):
                return
        except OSError as error:
            raise CommClosedError(str(error)) from error
        for run in list(self._in_flight):
            if run.worker and run.worker not in self._workers:
                self._lose(run, FishlightError(f"worker after worker is lost, last {run.worker}"))

    def _deal_out(self, sequences: Iterator[FrameSequence]) -> None:
        """Give each thread of each worker a run to prepare, as long as there are any."""
        most = _RUNS_PER_THREAD * self._workers.thread_count
        for worker in self._workers:
            while self._workers.has_free_thread(worker) and (
                self._lost or len(self._in_flight) < most
            ):
                if not self._start_run(worker, sequences):
                    return

    def _lose(self, run: _RunInFlight, error: BaseException) -> None:
        """Have a run dealt out again, from its beginning."""
        run.losses += 1
        if run.losses > MOST_ATTEMPTS * len(run.run) + _MOST_LOSSES:
            self._fail(run, error)
            return
        self._let_go(run)
        run.worker = run.awaited = ""
        run.is_prepared, run.prepared, run.lit = False, None, None
        self._lost.append(run)

    def _let_go(self, run: _RunInFlight) -> None:
        """Let another run have the worker's thread that this one has, if it has one."""
        if run.worker and not run.is_prepared:
            self._workers.give_back_thread(run.worker)

    def _start_run(self, worker: str, sequences: Iterator[FrameSequence]) -> bool:
        if self._lost:
            self._prepare(self._lost.popleft(), worker)
            return True
        depth = min((len(queue.runs) for queue in self._queues), default=_DEPTH)
        if depth >= _DEPTH and len(self._queues) < _MOST_OPEN:
            self._open_next(sequences)
        while True:
            self._queues = [queue for queue in self._queues if not queue.sequence.is_finished]
            for queue in sorted(self._queues, key=lambda queue: len(queue.runs)):
                run = queue.sequence.next_run()
                if run is not None:
                    started = _RunInFlight(queue, run, worker)
                    queue.runs.append(started)
                    self._in_flight[started] = None
                    self._prepare(started, worker)
                    return True
            if not self._open_next(sequences):
                return False

    def _open_next(self, sequences: Iterator[FrameSequence]) -> bool:
        sequence = next(sequences, None)
        if sequence is not None:
            self._queues.append(_Queue(sequence))
        return sequence is not None

    def _prepare(self, run: _RunInFlight, worker: str) -> None:
        run.worker = worker
        self._workers.take_thread(worker)
        step, job = self._steps.prepare, run.queue.sequence.job
        run.prepared = self._submit(run, seceded, step, job, run.run, workers=[worker])

    def _light(self, run: _RunInFlight) -> None:
        sequence = run.queue.sequence
        run.follows = run.follows or (sequence.link, sequence.before)
        run.lit = self._submit(
            run,
            with_share_of_threads,
            self._steps.light,
            sequence.job,
            run.run,
            run.prepared,
            *run.follows,
            priority=_LIGHT_FIRST,
        )

    def _submit(self, run: _RunInFlight, *call: Any, **wishes: Any) -> Future[Any]:
        run.awaited = f"{self._name}-{next(self._numbers)}"
        future = self._client.submit(*call, key=run.awaited, pure=False, **wishes)
        future.add_done_callback(lambda future: self._done.put((run, future)))
        return future

    def _go_on(self, run: _RunInFlight, future: Future[Any]) -> None:
        if future.cancelled():
            raise CancelledError(future.key)
        error = future.exception()
        if isinstance(error, KilledWorker):
            self._lose(run, error)
        elif error is not None:
            self._fail(run, error)
        elif future == run.prepared:
            self._let_go(run)
            run.is_prepared = True
            if run.follows is not None or run is run.queue.runs[0]:
                self._light(run)
        elif future == run.lit:
            self._conclude(run, future.result())
        else:
            self._finish(run)

    def _conclude(self, run: _RunInFlight, lit: LitRun) -> None:
        """Let the next run's lights be found, and draw this one's."""
        queue = run.queue
        if run.record is None:
            run.record = lit.record
            queue.runs.popleft()
            queue.sequence.conclude(run.run, lit.record)
            if queue.runs and queue.runs[0].is_prepared:
                self._light(queue.runs[0])
        if lit.lights:
            step, job = self._steps.preview, queue.sequence.job
            run.preview = self._submit(
                run, step, job, run.prepared, run.lit, priority=_PREVIEW_NEXT
            )
        else:
            self._finish(run)

    def _finish(self, run: _RunInFlight) -> None:
        del self._in_flight[run]
        if run.record is not None:
            self._on_concluded(run.record)

    def _fail(self, run: _RunInFlight, error: BaseException) -> None:
        """Give up a run, and with it those after it, whose lights would have followed."""
        queue = run.queue
        for given_up in {run, *queue.runs}:
            self._let_go(given_up)
            given_up.awaited = given_up.worker = ""
            self._in_flight.pop(given_up, None)
            if given_up in self._lost:
                self._lost.remove(given_up)
        if queue in self._queues:
            self._queues.remove(queue)
        if not queue.has_failed:  # of one whose last pictures are drawn, too
            queue.has_failed = True
            self._on_failed(queue.sequence, error)
