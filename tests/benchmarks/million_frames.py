"""A million frames planned and tracked, on workers that only sleep.

    python -m tests.benchmarks.million_frames [frames] [slots] [seconds a frame]

A thousand slots are threads of this process that take a run, sleep as long as its frames would
take, and answer; scheduler and client are threads of it too. What is left is all that a batch keeps
and does beside the frames: the memory and the CPU time of this one process.
"""

import resource
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import Client, LocalCluster

from capture.manifest import FrameRecord
from lighting.measures.sequence_table import FrameRow
from render.batch.frames import LitRun, RunRecord
from render.batch.runs import RUN_LENGTH, Run
from render.batch.steps import Steps
from render.batch.tracking import Tracker

_TELL_EVERY = 50_000


@dataclass
class SleepingSequence:
    """Runs of a recording that is not there, as RecordingSequence hands them out."""

    job: Any
    frames: int
    link: str = "0"
    before: Path | None = None
    in_flight: int = 0
    position: int = 0

    @property
    def is_finished(self) -> bool:
        """Whether every run is concluded."""
        return self.position >= self.frames and not self.in_flight

    def next_run(self) -> Run | None:
        """Return the next run: records of three exposures, as they travel."""
        if self.position >= self.frames:
            return None
        length = min(RUN_LENGTH, self.frames - self.position)
        brackets = tuple(
            tuple(
                FrameRecord(
                    f"frames/{3 * index + exposure:06d}.jpg", 0.01, "0" * 64, (512, 512),
                    3 * index + exposure, index, float(index),
                )
                for exposure in range(3)
            )
            for index in range(self.position, self.position + length)
        )  # fmt: skip
        run = Run(self.position, brackets, ("0" * 16,) * length)
        self.position += length
        self.in_flight += 1
        return run

    def conclude(self, run: Run, record: RunRecord) -> None:
        """Go on, and see that no run was left out or taken twice."""
        if record.link != str(run.start) or self.link != str(max(run.start - RUN_LENGTH, 0)):
            raise AssertionError(f"run {run.start} after {self.link}")
        self.link = record.link
        self.in_flight -= 1


@dataclass(frozen=True)
class Simulated:
    """What a simulation took: of this process, and its largest size so far."""

    frames: int
    wall_s: float
    cpu_s: float
    peak_bytes: int


def simulate_batch(frames: int, recordings: int, slots: int, sleep_s: float) -> Simulated:
    """Take so many frames through the tracker; `sleep_s` is how long a frame takes."""
    concluded = [0]

    def on_concluded(record: RunRecord) -> None:
        concluded[0] += len(record.rows)
        if concluded[0] % _TELL_EVERY < len(record.rows):
            peak_gib = _peak_bytes() / 2**30
            print(f"{concluded[0]} frames, peak {peak_gib:.2f} GiB", file=sys.stderr, flush=True)

    def on_failed(_sequence: object, error: BaseException) -> None:
        raise error

    with (
        LocalCluster(
            n_workers=-(-slots // 50),
            threads_per_worker=min(slots, 50),
            processes=False,
            dashboard_address="127.0.0.1:0",
        ) as cluster,
        Client(cluster) as client,
    ):
        tracker = Tracker(
            client, on_concluded, on_failed, steps=Steps(_sleep, light_nothing, _refuse)
        )
        sequences = (SleepingSequence(sleep_s, frames // recordings) for _ in range(recordings))
        start_s, start_cpu_s = time.perf_counter(), time.process_time()
        tracker.run_all(sequences)
        wall_s, cpu_s = time.perf_counter() - start_s, time.process_time() - start_cpu_s
    frames -= frames % recordings
    if concluded[0] != frames:
        raise AssertionError(f"{concluded[0]} frames of {frames} were concluded")
    return Simulated(frames, wall_s, cpu_s, _peak_bytes())


def _peak_bytes() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _sleep(sleep_s: Any, run: Run) -> Any:
    time.sleep(sleep_s * len(run))
    return b"prepared"


def light_nothing(
    _job: Any, run: Run, _prepared: Sequence[Any], _link: str, _before: Path | None
) -> LitRun:
    """Return the record of a run as long as a real one."""
    row = FrameRow(
        recording="sky-01234567", bracket=0, time_s=0.0, exposure_count=3, shortest_s=0.001,
        longest_s=0.1, clipped_share=0.0, total_irradiance=1.0, light_count=64,
        map_file="sky-01234567/maps/000000-0123456789abcdef.exr",
        lights_file="sky-01234567/lights/000000-0123456789abcdef.json",
    )  # fmt: skip
    return LitRun(RunRecord(str(run.start), (row,) * len(run)), {})


def _refuse(*_: Any) -> None:
    raise AssertionError("there are no lights to draw")


if __name__ == "__main__":
    defaults = ("1000000", "1000", "0.06")  # a bracket of 512² takes one core about so long
    frames, slots, sleep_s = (*sys.argv[1:], *defaults[len(sys.argv) - 1 :])
    result = simulate_batch(int(frames), max(1, int(frames) // 10_000), int(slots), float(sleep_s))
    print(
        f"{result.frames} frames, {slots} slots: {result.wall_s:.0f} s, "
        f"{1e3 * result.cpu_s / result.frames:.3f} ms of CPU a frame, "
        f"peak {result.peak_bytes / 2**30:.2f} GiB"
    )
