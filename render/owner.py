"""Objects that own memory outside Python's: used in a `with` block, and released at its end."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Owner(ABC):
    """A context manager that releases what it owns."""

    @abstractmethod
    def release(self) -> None:
        """Free what is owned."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()
