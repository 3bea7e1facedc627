"""How much a client may send, and how many there may be."""

import time
from collections.abc import Callable

MOST_CLIENTS = 16
"""Of pictures, and as many of lights."""

MOST_MESSAGE_BYTES = 4096
SEND_TIMEOUT_S = 10.0
"""A client that takes none of a message for so long is let go."""

HEARTBEAT_S = 20.0


class Allowance:
    """Messages a client may send: a burst, and so many a second after it.

    A page tells of each picture that it was shown, up to 120 a second, and of 30 changes.
    """

    def __init__(
        self, rate_hz: float = 200.0, burst: int = 200, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate_hz = rate_hz
        self._burst = burst
        self._now_s = now_s
        self._left = float(burst)
        self._last_s = now_s()

    def take(self) -> bool:
        """Count a message; False if it is one too many."""
        now_s = self._now_s()
        self._left = min(self._left + self._rate_hz * (now_s - self._last_s), self._burst)
        self._last_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True
