"""The `fishlight` command: the stages' tools under one name, and one place for errors."""

import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import App, CycloptsError, Parameter

import calibration.cli
import capture.cli
import lighting.cli
import render.cli
from capture.errors import FishlightError

app = App(
    name="fishlight",
    help="Turns a fisheye or mirror-ball camera into the lights of a rendered scene.",
    version=lambda: version("fishlight"),
    default_parameter=Parameter(negative=""),
)
for stage in (capture.cli, calibration.cli, lighting.cli, render.cli):
    for command, name in stage.COMMANDS:
        app.command(command, name=name)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; a known error is one line on stderr and exit code 2.

    Any other exception is a defect of fishlight and keeps its traceback.
    """
    try:
        app(arguments, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        sys.exit(_fail(f"{error} See fishlight --help."))
    except FishlightError as error:
        sys.exit(_fail(str(error)))
    except BrokenPipeError:  # the reader of a pipe has seen enough: fishlight inspect … | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:  # no permission, disk full, name too long
        sys.exit(_fail(f"{error.filename or 'a file'}: {error.strerror or error}"))
    except KeyboardInterrupt:
        sys.exit(130)


def _fail(message: str) -> int:
    print("fishlight: " + " ".join(message.split()), file=sys.stderr)
    return 2
