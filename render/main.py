"""The `fishlight` command: the stages' tools under one name, and one place for errors."""

import sys

from cyclopts import App

import calibration.cli
import capture.cli
import lighting.cli
import render.cli
from capture.errors import FishlightError

app = App(
    name="fishlight",
    help="Turns a fisheye or mirror-ball camera into the lights of a rendered scene.",
    version_flags=["--version"],
)
for stage in (capture.cli, calibration.cli, lighting.cli, render.cli):
    for command, name in stage.COMMANDS:
        app.command(command, name=name)


def main() -> None:
    """Run the command line; a known error is one line on stderr and exit code 2."""
    try:
        app(exit_on_error=False, print_error=True)
    except FishlightError as error:
        sys.exit(_fail(str(error)))


def _fail(message: str) -> int:
    print(f"fishlight: {message}", file=sys.stderr)
    return 2
