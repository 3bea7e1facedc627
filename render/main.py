"""Where the `fishlight` command starts, and the one place for errors."""

import os
import signal
import sys
from collections.abc import Sequence
from difflib import get_close_matches

from capture.printable import printable


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; a known error is one line on stderr and exit code 2.

    Any other exception is a defect of fishlight and keeps its traceback. A command's modules are
    imported when it is called, so that light ones start fast; one that cannot be imported is a
    broken installation, and told in a line too.
    """
    # Threads that wait for the next compiled loop are to sleep: OpenMP's default is to keep their
    # cores busy for milliseconds after each, while the next bracket is decoded. Read once, when
    # numba first starts its threads.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    # For the same reason: a frame's matrices are small, and one thread multiplies them as fast.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from cyclopts import CycloptsError, UnknownCommandError

        from capture.errors import FishlightError
        from capture.kernel_cache import drop_stale_kernels
        from render.app import app

        drop_stale_kernels()
    except ImportError as error:
        sys.exit(_fail(_broken(error)))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so it tidies up
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        place, asked = (app["chart"], tokens[1:]) if tokens[:1] == ["chart"] else (app, tokens)
        if asked[:1] in ([], ["--help"], ["-h"]):
            place.resolved_commands()  # imports them all: their docstrings are the overview
        app(tokens, exit_on_error=False, print_error=False)
    except UnknownCommandError as error:  # whose own text imports every command
        names = [name for name in error.app or () if not name.startswith("-")]
        sys.exit(_fail(_unknown_command(error.unused_tokens or (), names)))
    except CycloptsError as error:
        sys.exit(_fail(f"{error} See fishlight --help."))
    except FishlightError as error:
        sys.exit(_fail(str(error)))
    except ImportError as error:
        sys.exit(_fail(_broken(error)))
    except BrokenPipeError:  # the reader of a pipe has seen enough: fishlight inspect … | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:  # no permission, disk full, name too long
        sys.exit(_fail(f"{error.filename or 'a file'}: {error.strerror or error}"))
    except MemoryError as error:
        sys.exit(_fail(f"not enough memory; smaller or fewer pictures take less ({error})"))
    except KeyboardInterrupt:
        sys.exit(130)


def _fail(message: str) -> int:
    # File names are in it, which may hold what steers a terminal.
    print(f"fishlight: {printable(' '.join(message.split()))}", file=sys.stderr)
    return 2


def _unknown_command(tokens: Sequence[str], names: Sequence[str]) -> str:
    typed = tokens[0] if tokens else ""
    meant = get_close_matches(typed, names, n=1)
    hint = f"did you mean {meant[0]}?" if meant else f"there are {', '.join(names)}."
    return f"no command {typed!r}; {hint} See fishlight --help."


def _broken(error: ImportError) -> str:
    reason = error.__cause__ or error
    return f"the installation is broken ({reason}); `make setup` makes it again"
