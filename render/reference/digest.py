"""What tells pictures apart by all that they are made of.

Input  : scenes, cameras, maps, settings.    Output : a digest.
Cost   : 1 ms for each MB of arrays.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import is_dataclass
from typing import Any

import numpy as np


def digest_of(*settings: Any) -> str:
    """Return a digest of all numbers, arrays and names in `settings`, 64 hexadecimal digits.

    These may be tuples, dataclasses, arrays and plain values, in one another.
    """
    digest = hashlib.sha256()
    for part in _flat(settings):
        digest.update(part)
    return digest.hexdigest()


def _flat(part: Any) -> Iterable[bytes]:
    if is_dataclass(part) and not isinstance(part, type):
        yield type(part).__name__.encode()
        part = tuple(vars(part).items())
    if isinstance(part, np.ndarray):
        yield f"{part.dtype}{part.shape}".encode()
        yield np.ascontiguousarray(part).tobytes()
    elif isinstance(part, tuple):
        yield f"({len(part)})".encode()
        for each in part:
            yield from _flat(each)
    else:
        yield f"{part!r};".encode()
