"""Minutes of a live session, watched and followed, on demand: `make soak`, or soak.py MINUTES.

Prints its memory, threads and files every half minute, and fails if after the first two minutes,
in which every setting was made once, memory grows by more than 5 %, if a thread or a file is left
over, or if its counters do not add up.
"""

import asyncio
import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import aiohttp

from render.live.following import parse_address

LIVE = [sys.executable, "-c", "from render.main import main; main()", "live"]
RECORDING = Path(__file__).resolve().parents[2] / "recordings" / "outdoor"
MOST_GROWTH = 0.05
SETTLED_S = 120.0
MOST_MORE = 2
"""Threads or files more than then: pools of threads come and go by one or two."""
CHANGES = ({"count": 32}, {"count": 64}, {"method": "median-cut"}, {"method": "adaptive"})


def measures(pid: int) -> tuple[float, int, int]:
    """Return resident memory in MB, threads and open files of a process."""
    status = Path(f"/proc/{pid}/status").read_text()
    resident_kb, threads = (
        int(re.search(rf"{name}:\s+(\d+)", status)[1]) for name in ("VmRSS", "Threads")
    )
    return resident_kb / 1024, threads, len(list(Path(f"/proc/{pid}/fd").iterdir()))


async def watch(address: str, path: str, until_s: float) -> int:
    """Take what comes, and change a setting now and then; return the number of messages."""
    url, token = parse_address(address)
    count = 0
    async with (
        aiohttp.ClientSession(headers={"Authorization": f"Bearer {token}"}) as session,
        session.ws_connect(url.replace("lights", path), max_msg_size=0) as socket,
    ):
        while time.monotonic() < until_s:
            message = await socket.receive()
            count += 1
            if path == "view":
                length = int.from_bytes(message.data[:4], "little")
                shown = json.loads(message.data[4 : 4 + length])["number"]
                said = {"shown": shown}
                if count % 40 == 0:
                    said["set"] = CHANGES[count // 40 % len(CHANGES)]
                await socket.send_str(json.dumps(said))
    return count


async def run(minutes: float) -> None:
    """Run a session for so long, and judge it."""
    with tempfile.TemporaryDirectory() as output:
        options = ["--rate", "15", "--port", "0", "--headless", "-o", output]
        process = subprocess.Popen(
            [*LIVE, str(RECORDING), *options], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        begin_s = time.monotonic()
        until_s = begin_s + 60 * minutes
        clients = [
            asyncio.create_task(watch(address, path, until_s))
            for path in ("view", "view", "lights")
        ]
        settled = halfway = None
        while time.monotonic() < until_s:
            await asyncio.sleep(30.0)
            now = measures(process.pid)
            elapsed_s = time.monotonic() - begin_s
            print(f"{elapsed_s:6.0f} s  {now[0]:7.1f} MB  threads {now[1]}  files {now[2]}")
            if settled is None and elapsed_s >= SETTLED_S:
                settled = now
            if halfway is None and elapsed_s >= 30 * minutes:
                halfway = now
        counts = [await client for client in clients]
        await asyncio.sleep(1.0)
        last = measures(process.pid)
        process.send_signal(signal.SIGINT)
        summary = process.stdout.read()
        assert process.wait(20) == 0
    print(summary.strip(), f"; messages to each client: {counts}")
    assert settled is not None, f"soak for more than {SETTLED_S / 60:.0f} minutes"
    assert halfway is not None
    growth = last[0] / settled[0] - 1
    later = last[0] / halfway[0] - 1  # about half of it if there is a leak; about none if not
    print(f"memory {growth:+.1%} since {SETTLED_S:.0f} s, {later:+.1%} in the second half")
    counters = {name: int(value) for value, name in re.findall(r"(\d+) (\w+)", summary)}
    lost = counters["captured"] - sum(counters[n] for n in ("replaced", "rendered", "failed"))
    assert 0 <= lost <= 2, f"{lost} brackets are in no counter (those that waited at the end are)"
    assert growth <= MOST_GROWTH
    assert last[1] <= settled[1] + MOST_MORE
    assert last[2] <= settled[2] + MOST_MORE


if __name__ == "__main__":
    asyncio.run(run(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0))
