"""Progress of long work: shown on a terminal, silent anywhere else."""

import sys
from collections.abc import Iterable
from typing import TypeVar

from rich.console import Console
from rich.progress import track

Item = TypeVar("Item")


def progress(items: Iterable[Item], description: str, total: int | None = None) -> Iterable[Item]:
    """Yield `items`, with a bar on stderr while they last; `total` if they do not know it."""
    console = Console(stderr=True)
    silent = not sys.stderr.isatty()
    return track(items, description, total=total, console=console, disable=silent, transient=True)
