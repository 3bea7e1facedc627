"""What lights remember from one frame to the next, on disk: to go on where a batch was cut off.

Input  : StreamMemory.    Output : MessagePack, every bit of every number in it.
It is read by the fishlight that wrote it: its version is in the file's name.
"""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from capture.errors import InputError
from capture.files import read_bytes
from capture.output import replacing
from lighting.stream.light_stream import StreamMemory


def write_memory(path: Path, memory: StreamMemory | None) -> None:
    """Write what the last frame leaves to the next; None if no frame had lights yet."""
    with replacing(path) as partial:
        partial.write_bytes(msgspec.msgpack.encode(memory, enc_hook=_encode))


def read_memory(path: Path) -> StreamMemory | None:
    """Return what `write_memory` wrote; InputError if it cannot be read."""
    try:
        return msgspec.msgpack.decode(read_bytes(path), type=StreamMemory | None, dec_hook=_decode)
    except (msgspec.MsgspecError, ValueError, TypeError) as error:
        raise InputError(f"{path}: no memory of lights ({error}); remove it") from None


def _encode(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"nothing is known of {type(value)}")


def _decode(_kind: type, parts: Any) -> Any:
    dtype, shape, content = parts
    return np.frombuffer(content, dtype).reshape(shape)
