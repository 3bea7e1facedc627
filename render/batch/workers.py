"""The workers that a cluster has by now, and how many of their threads have a run to prepare."""

import time
from collections import Counter
from collections.abc import Callable, Iterator

from distributed import Client

_LOOK_S = 2.0
"""How often to look which workers are there."""


class Workers:
    """Those of one scheduler; iterating gives their addresses.

    Parameters
    ----------
    client : Client
    on_none : callable
        Told each time that there come to be none.
    """

    def __init__(self, client: Client, on_none: Callable[[], None]) -> None:
        self._client = client
        self._on_none = on_none
        self._threads: dict[str, int] = {}
        self._busy: Counter[str] = Counter()
        self._looked_s = 0.0
        self._is_none_told = False

    def __iter__(self) -> Iterator[str]:
        return iter(self._threads)

    def __contains__(self, worker: object) -> bool:
        return worker in self._threads

    @property
    def thread_count(self) -> int:
        """Threads of all workers."""
        return sum(self._threads.values())

    def look(self, *, is_to_wait: bool) -> bool:
        """Find out who is there; False if the last look was just now, and found somebody.

        With `is_to_wait`, return only when somebody is there.

        Raises
        ------
        OSError
            If the scheduler is lost.
        """
        if self._threads and time.monotonic() - self._looked_s < _LOOK_S:
            return False
        self._find()
        while is_to_wait and not self._threads:
            self._client.wait_for_workers(1)
            self._find()
        self._looked_s = time.monotonic()
        return True

    def _find(self) -> None:
        self._threads = self._client.nthreads()
        if not self._threads and not self._is_none_told:
            self._on_none()
        self._is_none_told = not self._threads

    def has_free_thread(self, worker: str) -> bool:
        """Whether a worker could prepare one more run."""
        return self._busy[worker] < self._threads[worker]

    def take_thread(self, worker: str) -> None:
        """Count a run that a worker begins to prepare."""
        self._busy[worker] += 1

    def give_back_thread(self, worker: str) -> None:
        """Count a run that is prepared, or given up."""
        self._busy[worker] -= 1
