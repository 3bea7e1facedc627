"""One slot from which every client of the server takes the newest message, at its own pace."""

import asyncio
from typing import Generic, TypeVar

T = TypeVar("T")


class Channel(Generic[T]):
    """Holds the newest message; for one event loop."""

    def __init__(self) -> None:
        self._newest: T | None = None
        self._number = 0
        self._changed = asyncio.Condition()

    async def put(self, message: T) -> None:
        """Replace the message."""
        async with self._changed:
            self._newest = message
            self._number += 1
            self._changed.notify_all()

    async def after(self, number: int) -> tuple[int, T]:
        """Wait for a message newer than `number` (0 for any); return its number and it."""
        async with self._changed:
            await self._changed.wait_for(lambda: self._number > number)
            assert self._newest is not None
            return self._number, self._newest
