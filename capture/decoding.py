"""Decoding in a process of its own, for files whose decoders cannot be trusted with any bytes.

Input  : a file and what it is.    Output : facts and arrays, or one line that says why not.
Cost   : 0.3 s to start a process, once; then what the pipe takes, about 0.4 ms a megabyte.
Fails  : a decoder that a crafted file takes over without crashing it has the user's rights; this
         contains accidents, and is no sandbox.

RAW and OpenEXR decoders have a history of memory faults on crafted files, and they parse what
anyone may have sent. A process decodes file after file, within limits of memory and time. One that
crashes or hangs costs the file that it was at; the next file gets a new one.
"""

import atexit
import io
import math
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.decoding_worker import LENGTH, Reply, Request
from capture.errors import InputError, UnreadableFrame

# -P: the folder it happens to be started in holds no modules for it.
_COMMAND = (sys.executable, "-P", "-m", "capture.decoding_worker")
_TIMEOUT_S = 120.0
_MAX_BYTES = 6 * 2**30  # 2^27 pixels as eight float32 channels, with room; threads' stacks count
_MAX_MESSAGE_BYTES = 2**26

_idle: "list[_Worker]" = []


def decode(kind: str, path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the facts and arrays that a decoder of capture.decoding_worker finds in a file.

    Threads that decode at the same time get a process each.

    Raises
    ------
    UnreadableFrame
        If the file is damaged, crashes its decoder, or takes it too much memory or time.
    InputError
        If the file is of a kind that is not read.
    """
    worker = _take_worker()
    try:
        reply, arrays = worker.ask(Request(kind, str(path.absolute())))
    except EOFError:
        raise UnreadableFrame(f"{path}: {worker.end()}; the file is damaged") from None
    except BaseException:  # an interrupted answer would be taken for the next file's
        worker.end()
        raise
    _idle.append(worker)
    if reply.defect is not None:
        raise RuntimeError(f"the decoder of {path} failed:\n{reply.defect}")
    if reply.error is not None:
        name, message = reply.error
        raise {"InputError": InputError}.get(name, UnreadableFrame)(
            message.replace(str(path.absolute()), str(path))
        )
    return reply.facts, arrays


class _Worker:
    """A process that decodes, and the pipes to and from it."""

    def __init__(self) -> None:
        self._timed_out = False
        path = [str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", "")]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, path)),
            # Each thread of numpy's linear algebra would take its share of the address space.
            "OPENBLAS_NUM_THREADS": "1",
        }
        self._process = subprocess.Popen(
            [*_COMMAND, str(_MAX_BYTES)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=environment,
        )
        self._requests = cast(io.RawIOBase, self._process.stdin)
        self._replies = cast(io.RawIOBase, self._process.stdout)
        try:
            self._receive()
        except EOFError:
            raise RuntimeError("the process that decodes files does not start") from None

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def ask(self, request: Request) -> tuple[Reply, dict[str, NDArray[Any]]]:
        """Return the answer; EOFError if the process ended before it was complete."""
        message = msgspec.msgpack.encode(request)
        timer = threading.Timer(_TIMEOUT_S, self._stop_late)
        timer.start()
        try:
            self._requests.write(LENGTH.pack(len(message)) + message)
            return self._receive()
        except BrokenPipeError:
            raise EOFError from None
        finally:
            timer.cancel()

    def end(self) -> str:
        """Stop the process; return why it had stopped by itself, if it had."""
        self._process.kill()
        with self._process as process:  # closes the pipes and waits
            pass
        if self._timed_out:
            return f"not decoded within {_TIMEOUT_S:g} s"
        if process.returncode < 0:
            return f"its decoder crashed ({signal.Signals(-process.returncode).name})"
        return f"its decoder ended with code {process.returncode}"

    def _stop_late(self) -> None:
        self._timed_out = True
        self._process.kill()

    def _receive(self) -> tuple[Reply, dict[str, NDArray[Any]]]:
        (length,) = LENGTH.unpack(self._read(LENGTH.size).data)
        if length > _MAX_MESSAGE_BYTES:
            raise EOFError
        try:
            reply = msgspec.msgpack.decode(self._read(length).data, type=Reply)
        except msgspec.DecodeError:
            raise EOFError from None
        arrays = {}
        for head in reply.arrays:
            dtype = np.dtype(head.dtype)
            pixels = self._read(math.prod(head.shape) * dtype.itemsize)
            arrays[head.name] = pixels.view(dtype).reshape(head.shape)
        return reply, arrays

    def _read(self, size_bytes: int) -> NDArray[np.uint8]:
        if not 0 <= size_bytes <= _MAX_BYTES:
            raise EOFError
        data = np.empty(size_bytes, np.uint8)
        done = 0
        while done < size_bytes:
            count = self._replies.readinto(data[done:].data)
            if not count:
                raise EOFError
            done += count
        return data


def _take_worker() -> _Worker:
    while True:
        try:
            worker = _idle.pop()  # threads may take from it at the same time
        except IndexError:
            return _Worker()
        if worker.is_alive:
            return worker
        worker.end()


@atexit.register
def _end_workers() -> None:
    while _idle:
        _idle.pop().end()
