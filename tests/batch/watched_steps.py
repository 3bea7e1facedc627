"""Steps of runs that note what is done when; functions of a module, since they are pickled."""

import threading
import time
from collections import Counter
from typing import Any

from capture.errors import InputError
from render.batch.frames import LitRun
from tests.benchmarks.million_frames import light_nothing

prepared: list[tuple[str, int]] = []
lit: list[tuple[str, int]] = []
previewed: list[str] = []
counts: Counter[str] = Counter()
_lock = threading.Lock()


def forget() -> None:
    """Begin anew."""
    for notes in (prepared, lit, previewed, counts):
        notes.clear()


def prepare(job: Any, run: Any) -> str:
    with _lock:
        counts["preparing"] += 1
        counts["most preparing"] = max(counts["most preparing"], counts["preparing"])
    time.sleep(0.002)
    with _lock:
        counts["preparing"] -= 1
        prepared.append((job, run.start))
    return f"{job}{run.start}"


def light(job: Any, run: Any, frames: Any, link: str, before: Any) -> LitRun:
    assert frames == f"{job}{run.start}"
    lit.append((job, run.start))
    if job == "bad" and run.start >= 5 * 16:
        raise InputError("no space left")
    found = light_nothing(job, run, frames, link, before)
    return LitRun(found.record, {0: "lights"}) if job in ("shown", "full") else found


def preview(job: Any, frames: Any, _lit: Any) -> None:
    if job == "full" and len(previewed) >= 3:
        raise InputError("no space left")
    previewed.append(frames)
