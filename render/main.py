"""Where the `fishlight` command starts, and the one place for errors."""

import os
import signal
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; a known error is one line on stderr and exit code 2.

    Any other exception is a defect of fishlight and keeps its traceback. The stages are imported
    here, so that a broken installation is told in a line too.
    """
    try:
        from cyclopts import CycloptsError

        from capture.errors import FishlightError
        from render.app import app
    except ImportError as error:
        sys.exit(_fail(f"the installation is broken ({error}); `make setup` makes it again"))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so it tidies up
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
