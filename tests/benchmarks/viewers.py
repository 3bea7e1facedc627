"""What viewers cost a live session: the bundled recording, 640×480, as fast as it goes.

Case : one viewer and ten, in turns, on one session; they take whole moments and say so, and draw
nothing. `ms` is the session's processor time per moment, of all its threads; `ratio` is the one
viewer's over it, 0.9 at least if ten cost less than a tenth. The frame rates tell the same only
where the viewers, in a process of their own, have processors of their own.
"""

import asyncio
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import aiohttp

from render.live.following import parse_address

LIVE = [sys.executable, "-c", "from render.main import main; main()", "live"]
RECORDING = Path(__file__).resolve().parents[2] / "recordings" / "outdoor"
VIEWERS = (1, 10)
SETTLING_S = 1.5
MOMENTS = 100
TRACING_S = 300.0
"""Within which the view has to be traced; kernels may have to be compiled first."""

_PER_S = os.sysconf("SC_CLK_TCK")


class Watching:
    """So many viewers of a session; what the first of them is sent is kept."""

    def __init__(self, address: str, count: int) -> None:
        self._url, token = parse_address(address)
        self._headers = {"Authorization": f"Bearer {token}"}
        self._count = count
        self._opened = AsyncExitStack()
        self._tasks: list[asyncio.Task[None]] = []
        self.header: dict[str, Any] = {}
        self.messages = 0

    async def __aenter__(self) -> "Watching":
        session = await self._opened.enter_async_context(
            aiohttp.ClientSession(headers=self._headers)
        )
        for number in range(self._count):
            socket = await self._opened.enter_async_context(
                session.ws_connect(self._url.replace("lights", "view"), max_msg_size=0)
            )
            self._tasks.append(asyncio.create_task(self._take(socket, is_first=number == 0)))
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._opened.aclose()

    async def _take(self, socket: aiohttp.ClientWebSocketResponse, *, is_first: bool) -> None:
        async for message in socket:
            self.messages += 1
            length = int.from_bytes(message.data[:4], "little")
            header = json.loads(message.data[4 : 4 + length])
            if is_first:
                self.header = header
            await socket.send_str(json.dumps({"shown": header["number"]}))


def processor_s(pid: int) -> float:
    """Return the processor time that a process has taken, all threads together."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _PER_S


async def measured(address: str, pid: int, count: int) -> dict[str, float]:
    """Return processor time per moment, moments and messages a second with so many viewers."""
    async with Watching(address, count) as watching:
        await asyncio.sleep(SETTLING_S)
        begin = processor_s(pid), _moments(watching), watching.messages, time.monotonic()
        while _moments(watching) < begin[1] + MOMENTS:
            await asyncio.sleep(0.02)
        end = processor_s(pid), _moments(watching), watching.messages, time.monotonic()
    spent_s, moments, messages, elapsed_s = (b - a for a, b in zip(begin, end, strict=True))
    return {
        "ms": 1e3 * spent_s / moments,
        "moments a second": moments / elapsed_s,
        "messages a second to each": messages / count / elapsed_s,
    }


def _moments(watching: Watching) -> int:
    return int(watching.header["account"]["counters"]["rendered"])


async def _alternate(address: str, pid: int, rounds: int) -> dict[int, list[dict[str, float]]]:
    async with Watching(address, 1) as watching, asyncio.timeout(TRACING_S):
        while watching.header.get("is_draft", True) or "picture" not in watching.header["parts"]:
            await asyncio.sleep(0.2)
    found: dict[int, list[dict[str, float]]] = {count: [] for count in VIEWERS}
    for _ in range(rounds):
        for count in VIEWERS:
            found[count].append(await measured(address, pid, count))
    return found


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row for each number of viewers."""
    with tempfile.TemporaryDirectory() as output:
        options = ["--rate", "200", "--port", "0", "--headless", "-o", output]
        process = subprocess.Popen(
            [*LIVE, str(RECORDING), *options], stdout=subprocess.PIPE, text=True
        )
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            found = asyncio.run(_alternate(address, process.pid, max(repeats // 5, 2)))
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate()
    middle = {
        count: {name: statistics.median(each[name] for each in all_) for name in all_[0]}
        for count, all_ in found.items()
    }
    return [
        {
            "stage": "viewers",
            "case": "448² × 4 exposures, 64 lights, 640×480",
            "system": f"fishlight live, {count} viewer{'s' * (count > 1)}",
            "ms": values["ms"],
            "ratio": middle[VIEWERS[0]]["ms"] / values["ms"],
            "accuracy": {name: value for name, value in values.items() if name != "ms"},
        }
        for count, values in middle.items()
    ]
