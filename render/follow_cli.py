"""`fishlight follow`: the lights of a live session, as another program gets them."""

from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any, TextIO

from cyclopts import Parameter

from capture.arguments import WholeNumber
from capture.errors import InputError
from capture.output import check_place
from render.live.following import follow
from render.live.stream import StreamMessage


def follow_command(
    address: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    moments: WholeNumber | None = None,
    force: bool = False,
) -> None:
    """Follow the lights of a live session, printed or recorded, until it ends or Ctrl-C.

    Parameters
    ----------
    address
        As `fishlight live` prints it; the token may also be in FISHLIGHT_TOKEN.
    output
        File to be written, a line of JSON for each moment: what the stream sends, which has the
        object of lights.json in it.
    moments
        Stop after so many.
    force
        Replace the output if it exists.
    """
    if moments is not None and moments < 1:
        raise InputError(f"--moments {moments}: wanted at least 1")
    if output is not None:
        check_place(output, force=force)
    count = 0
    file: TextIO | None = None
    with ExitStack() as opened:

        def take(text: str, message: StreamMessage) -> bool:
            nonlocal count, file
            count += 1
            if output is None:
                print(_line(message), flush=True)
                return count != moments
            # With the first moment, so that an older file outlives an address where nobody is;
            # then as they come, so that what was followed lasts whatever ends it.
            file = file or opened.enter_context(output.open("w", encoding="utf-8"))
            file.write(f"{text}\n")
            file.flush()
            return count != moments

        with suppress(KeyboardInterrupt):
            follow(address, take)
    if output is not None:
        print(f"{output}: moments {count}")


def _line(message: StreamMessage) -> str:
    marks = [name for name in ("stale", "valid") if getattr(message, name)]
    state = ", ".join([message.state, *marks])
    head = (
        f"{message.frame:>7}  {message.time_s:12.3f} s  age {1e3 * message.age_s:6.0f} ms  {state}"
    )
    return f"{head}: {_lights(message.lights)}"


def _lights(lights: dict[str, Any] | None) -> str:
    if lights is None:
        return "no lights yet"
    keys = [light for light in lights["lights"] if light["is_key"]]
    text = f"lights {len(lights['lights'])}, key lights {len(keys)}"
    if keys:
        strongest = max(keys, key=lambda light: sum(light["irradiance"]))
        direction = " ".join(f"{value:+.3f}" for value in strongest["direction"])
        text += f", the strongest toward {direction}"
    return text
