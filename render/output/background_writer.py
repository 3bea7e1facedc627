"""Files written behind the loop's back: it goes on while they are encoded.

Input  : calls that write.    Output : the files, in the order of the calls.
Cost   : the loop waits only while more than a few calls are outstanding, so memory is bounded.
Fails  : an error of a call is raised by a later one, or at the end.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

OUTSTANDING = 4
"""Calls that may wait."""


class BackgroundWriter:
    """One thread that makes the calls it is given, in order; a context manager.

    At its end all calls have been made, unless there was an error: then those not begun are
    dropped.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "fishlight-writer")
        self._calls: deque[Future[None]] = deque()

    def __enter__(self) -> Self:
        return self

    def call(self, write: Callable[[], None]) -> None:
        """Have `write` called, which must not enter parallel numba kernels; raise earlier errors.

        What it reads must not change any more.
        """
        while self._calls and (len(self._calls) >= OUTSTANDING or self._calls[0].done()):
            self._calls.popleft().result()
        self._calls.append(self._thread.submit(write))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            while error is None and self._calls:
                self._calls.popleft().result()
        finally:
            self._thread.shutdown(cancel_futures=True)
