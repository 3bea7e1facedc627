"""What every stage's commands share: types of arguments, and the text they print."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token

from capture.errors import InputError
from capture.printable import printable


def _whole_number(_type: Any, tokens: Sequence[Token]) -> int:
    """Return a whole number; cyclopts by itself rounds 3.7 to 4 without a word."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"wanted a whole number, got {tokens[0].value!r}.") from None


MAX_SIZE_PX = 8192

Output = Annotated[Path, Parameter(name=["--output", "-o"])]

WholeNumber = Annotated[int, Parameter(converter=_whole_number)]


def parse_exposures(text: str) -> tuple[float, ...]:
    """Return the numbers of a list such as "0.001, 1/250, 2".

    Raises
    ------
    InputError
        If a part is neither a number nor a fraction. Whether a number makes an exposure time is
        not judged here.
    """
    return tuple(_seconds(part) for part in text.split(","))


def _seconds(part: str) -> float:
    numerator, slash, denominator = part.partition("/")
    try:
        return float(numerator) / float(denominator) if slash else float(numerator)
    except (ValueError, ZeroDivisionError):
        raise InputError(
            f"--exposures: {part.strip()!r} is no time in seconds; write 0.001,0.01 or 1/1000,1/100"
        ) from None


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) in pixels of "640x480"; InputError for anything else."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise InputError(f"a size is WIDTHxHEIGHT, as in 640x480; got {text!r}")
    size_px = int(width), int(height)
    if not all(1 <= length <= MAX_SIZE_PX for length in size_px):
        raise InputError(f"width and height must be 1 to {MAX_SIZE_PX}, got {text}")
    return size_px


def tell(notes: Sequence[str]) -> None:
    """Print each note as a line on stderr."""
    for note in notes:
        print(f"note: {printable(note)}", file=sys.stderr)


def size_text(size_px: tuple[int, int]) -> str:
    """Return (width, height) as people read it."""
    return f"{size_px[0]}×{size_px[1]} px"
