"""Results of earlier runs, which are not measured again while code and machine are the same.

Input  : folders of code; a file of results by key.    Output : a digest; the results that hold.
"""

import hashlib
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Protocol, TypeVar

import msgspec

from capture.errors import InputError
from capture.output import write_json

_CODE = {".py", ".vert", ".frag", ".glsl"}

Result = TypeVar("Result", bound=msgspec.Struct)


class Timed(Protocol):
    """A result that says how long what it is of took."""

    @property
    def ms(self) -> float:
        """Milliseconds."""


TimedResult = TypeVar("TimedResult", bound=Timed)


@cache
def code_digest(*folders: Path) -> str:
    """Return what tells versions of the code in these folders, and machines, apart."""
    digest = hashlib.sha256(platform.node().encode())
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.suffix in _CODE:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def read_known(path: Path, kind: type[Result], digest: str) -> dict[str, Result]:
    """Return those results of a file of `write_known` whose keys begin with this digest.

    None if there is no file. Others are dropped, or the file would grow with every version.
    """
    try:
        found = msgspec.json.decode(path.read_bytes(), type=dict[str, dict[str, msgspec.Raw]])
        return {
            key: msgspec.json.decode(row, type=kind)
            for key, row in found["measurements"].items()
            if key.startswith(digest)  # only these are sure to have the fields of today
        }
    except FileNotFoundError:
        return {}
    except (OSError, msgspec.DecodeError, KeyError) as error:
        raise InputError(f"{path}: not a file of earlier results ({error}); remove it") from error


def write_known(path: Path, known: Mapping[str, msgspec.Struct]) -> None:
    """Write results for later runs, whole or not at all."""
    write_json(path, {"measurements": known})


def remembered(
    measured: Callable[[str, int], TimedResult],
    digest: str,
    names: Iterable[str],
    counts: Sequence[int],
    known: dict[str, TimedResult],
    slow_s: float,
) -> Iterator[TimedResult | None]:
    """Yield what `measured` makes of each name and count, from `known` or for it.

    A name that takes longer than `slow_s` gets None for all larger counts. `digest` tells what is
    measured, and by which code.
    """
    for name in names:
        is_slow = False
        for count in counts:
            if is_slow:
                yield None
                continue
            key = f"{digest} {name} {count}"
            if key not in known:
                known[key] = measured(name, count)
            is_slow = known[key].ms > 1e3 * slow_s
            yield known[key]
