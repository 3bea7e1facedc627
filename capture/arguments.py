"""Types of command-line arguments that every stage's commands share."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token


def _whole_number(_type: Any, tokens: Sequence[Token]) -> int:
    """Return a whole number; cyclopts by itself rounds 3.7 to 4 without a word."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"wanted a whole number, got {tokens[0].value!r}.") from None


Output = Annotated[Path, Parameter(name=["--output", "-o"])]

WholeNumber = Annotated[int, Parameter(converter=_whole_number)]
