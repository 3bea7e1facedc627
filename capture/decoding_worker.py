"""The process that decodes files of unknown origin; capture.decoding starts it and may kill it.

Run as `python -m capture.decoding_worker MAX_BYTES`. Each message on stdin is a Request; the answer
on stdout is a Reply and then the bytes of its arrays. The end of stdin ends the process.
"""

import os
import resource
import signal
import struct
import sys
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError

DECODERS = {
    "exr": "capture.exr_decoding:decode",
    "raw": "capture.raw_decoding:decode",
}
"""What can be decoded, and the function (path) → (facts, arrays) that does it. Its module is
imported only here: these are the parsers that are kept away from everything else."""

LENGTH = struct.Struct("<Q")
"""What goes before each message: its length in bytes."""

Decoded = tuple[dict[str, Any], dict[str, NDArray[Any]]]


class Request(msgspec.Struct, frozen=True):
    """A file to be decoded, and as what."""

    kind: str
    path: str


class ArrayHead(msgspec.Struct, frozen=True):
    """An array whose bytes follow the reply, in the order of the reply."""

    name: str
    dtype: str
    shape: tuple[int, ...]


class Reply(msgspec.Struct, frozen=True):
    """What came of a request: `facts` and arrays, or an error.

    `error` holds the class of an InputError and its message; `defect` a traceback of ours.
    """

    facts: dict[str, Any] = {}
    arrays: tuple[ArrayHead, ...] = ()
    error: tuple[str, str] | None = None
    defect: str | None = None


def main() -> None:
    """Decode files until stdin ends, within the memory that the command line allows."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the command, which ends this
    max_bytes = int(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    requests, replies = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    silence = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):  # the libraries print what they think of a file
        os.dup2(silence, descriptor)
    _send(replies, Reply(), {})
    while length := requests.read(LENGTH.size):
        request = msgspec.msgpack.decode(requests.read(LENGTH.unpack(length)[0]), type=Request)
        _send(replies, *_answer(request))


def _answer(request: Request) -> tuple[Reply, dict[str, NDArray[Any]]]:
    try:
        facts, arrays = _decoder(request.kind)(Path(request.path))
    except InputError as error:
        return Reply(error=(type(error).__name__, str(error))), {}
    except MemoryError:
        message = f"{request.path}: needs more memory than the decoder of a file may take"
        return Reply(error=("UnreadableFrame", message)), {}
    except Exception:
        return Reply(defect=traceback.format_exc()), {}
    heads = tuple(ArrayHead(name, array.dtype.str, array.shape) for name, array in arrays.items())
    return Reply(facts, heads), arrays


def _decoder(kind: str) -> Callable[[Path], Decoded]:
    module, _, name = DECODERS[kind].partition(":")
    return getattr(import_module(module), name)


def _send(replies: BinaryIO, reply: Reply, arrays: dict[str, NDArray[Any]]) -> None:
    message = msgspec.msgpack.encode(reply)
    replies.write(LENGTH.pack(len(message)) + message)
    for array in arrays.values():
        replies.write(np.ascontiguousarray(array).data)
    replies.flush()


if __name__ == "__main__":
    main()
