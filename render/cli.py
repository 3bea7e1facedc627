"""The render stage's commands."""

from collections.abc import Callable
from typing import Any

COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = ()
