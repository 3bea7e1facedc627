"""Command-line arguments that say which lights are wanted, shared by every command that finds them.

`--count auto` asks for as few lights as meet `--error`; without a number that is 5 %.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from cyclopts import Parameter, Token

from capture.errors import InputError
from lighting.methods.adaptive import MOST_LIGHTS_FOR_ERROR
from lighting.reduce import ADAPTIVE, METHODS

AUTO = "auto"
DEFAULT_ERROR = 0.05


def _count(_type: Any, tokens: Sequence[Token]) -> int | str:
    value = tokens[0].value
    try:
        return value if value == AUTO else int(value)
    except ValueError:
        raise ValueError(f"wanted a whole number or {AUTO}, got {value!r}.") from None


Count = Annotated[
    int | Literal["auto"],
    Parameter(
        converter=_count,
        show_choices=False,
        help=f"Number of lights, or {AUTO}: as few as keep the error below --error.",
    ),
]

Error = Annotated[
    float | None,
    Parameter(
        help="Relative error of the light behind occluders, as it is predicted, that --count "
        f"{AUTO} keeps below; {DEFAULT_ERROR:g} if not given.",
    ),
]

MethodName = Annotated[str, Parameter(help=f"How the lights are found: {', '.join(METHODS)}.")]


def most_lights(count: int | str, error: float | None, method: str) -> tuple[int, float | None]:
    """Return the most lights there may be, and the error that they are to meet, if any.

    Raises
    ------
    InputError
        If an error is given for a number of lights, or `auto` is asked of a method that cannot
        tell how large the error will be.
    """
    if isinstance(count, int):
        if error is not None:
            raise InputError(
                f"--error says how many lights there are, and so does --count {count}; "
                f"give --count {AUTO} with it"
            )
        return count, None
    if method != ADAPTIVE:
        raise InputError(f"--count {AUTO} is for --method {ADAPTIVE}, not for {method}")
    return MOST_LIGHTS_FOR_ERROR, DEFAULT_ERROR if error is None else error
