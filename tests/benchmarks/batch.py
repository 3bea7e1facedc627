"""Many frames by several processes, and what dealing them out costs.

Brackets of 3 JPEGs of 512² px become maps of 1024×512 and 64 lights, both written. Peer: the same
stages one after the other in this process, on one core, as a worker has; on all; and in a process
on each core, side by side: what no dealing out can beat on this machine. Times are per frame,
without starting the processes; CPU time is that of all of them together, and tells on a busy
machine what `ms` would be on an idle one.

Runs that take no time at all show what dealing them out costs the client, the scheduler and the
workers: milliseconds of their CPU time per frame.

`FISHLIGHT_BATCH_FRAMES=1000 python -m tests.benchmarks.bench --stages batch` takes as many brackets
as that; few of them are simulated, and seen again and again.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numba
import numpy as np
from distributed import Client

from calibration.camera import UP, Calibration
from calibration.files import read_calibration, write_calibration
from calibration.models.equidistant import Equidistant
from capture.manifest import read_manifest, write_manifest
from capture.merge import merge_bracket
from capture.picture_memory import PictureMemory
from capture.recording import open_recording
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.light_files import write_lights
from lighting.maps.environment_files import write_environment
from lighting.maps.remap import apply_remap, build_remap
from lighting.simulation.scenario import scenario
from lighting.simulation.simulate import simulate_recording
from lighting.stream.light_stream import LightPlan, next_lights
from render.batch.batch import run_batch
from render.batch.cluster import connected
from render.batch.runs import Settings
from tests.benchmarks.million_frames import simulate_batch
from tests.environments import outdoors

SIZE = 512
FRAMES = int(os.environ.get("FISHLIGHT_BATCH_FRAMES", "96"))
SIMULATED = 16
SETTINGS = Settings(("remap", "lights"), LightPlan(64), 512)
CASE = f"{FRAMES} × 3 JPEG of {SIZE}² → 1024×512 → 64 lights"
CAMERA = Calibration(Equidistant(((SIZE - 1) / 2,) * 2, SIZE / np.pi), (SIZE,) * 2, np.pi / 2, UP)


class _Times(NamedTuple):
    """Of a frame."""

    wall_ms: float
    cpu_ms: float


def run(_repeats: int) -> list[dict[str, Any]]:
    """Return a row for each number of workers and peer, and for dealing out."""
    cores = len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder:
        recording = record_again_and_again(Path(folder) / "timed", FRAMES)
        warming = record_again_and_again(Path(folder) / "warming", 4 * cores)
        output = Path(folder) / "out"
        times: dict[str, _Times] = {}
        for count in dict.fromkeys((1, cores)):
            name = f"one after the other, {count} {'core' if count == 1 else 'cores'}"
            chosen = sorted(os.sched_getaffinity(0))[:count]
            times[name] = _timed_replay(recording, output, chosen)
        times[f"one after the other, {cores} side by side"] = _timed_side_by_side(recording, output)
        for workers in dict.fromkeys((1, 2, cores)):
            name = f"batch, {workers} {'worker' if workers == 1 else 'workers'}"
            times[name] = _timed_batch(recording, warming, output, workers)
    sequential = times["one after the other, 1 core"]
    rows = [
        {
            "stage": "batch",
            "case": CASE,
            "system": name,
            "ms": found.wall_ms,
            "ratio": sequential.wall_ms / found.wall_ms,
            "accuracy": {"ms of CPU": found.cpu_ms},
        }
        for name, found in times.items()
    ]
    simulated = simulate_batch(frames=16_000, recordings=10, slots=64, sleep_s=0.0)
    rows.append(
        {
            "stage": "batch",
            "case": "dealing out frames that take no time",
            "system": "batch",
            "ms": 1e3 * simulated.cpu_s / simulated.frames,
            "accuracy": {},
        }
    )
    return rows


def record_again_and_again(folder: Path, frames: int) -> Path:
    """Return a recording of so many brackets, all of a few that were simulated."""
    folder.mkdir()
    calibration_path = folder / "calibration.json"
    write_calibration(calibration_path, CAMERA)
    simulated = min(SIMULATED, frames)
    moments = scenario([outdoors(256)], bracket_count=simulated, rate_hz=2, yaw_rad_per_s=0.2)
    path = folder / "recording"
    simulate_recording(
        path,
        moments,
        calibration_path,
        exposures_s=(1 / 4000, 1 / 250, 1 / 16),
        source="simulated for the benchmark",
    )
    manifest = read_manifest(path)
    length = len(manifest.frames) // simulated
    records = []
    for index in range(frames * length):
        again = manifest.frames[index % (simulated * length)]
        name = f"frames/again-{index:06d}.jpg"
        os.link(path / again.file, path / name)
        records.append(
            msgspec.structs.replace(
                again,
                file=name,
                index=index,
                bracket=index // length,
                timestamp_s=index / (2 * length),
            )
        )
    write_manifest(path, msgspec.structs.replace(manifest, frames=tuple(records)))
    return path


def _timed_side_by_side(recording: Path, output: Path) -> _Times:
    """Return milliseconds a frame of as many replays at once as there are cores."""
    cores = sorted(os.sched_getaffinity(0))
    with ProcessPoolExecutor(len(cores), get_context("spawn")) as processes:
        calls = [
            processes.submit(_timed_replay, recording, output.with_name(f"out-{core}"), [core])
            for core in cores
        ]
        times = [call.result() for call in calls]
    wall_ms, cpu_ms = np.mean(times, axis=0)
    return _Times(wall_ms / len(cores), cpu_ms)


def _timed_replay(recording_path: Path, output: Path, chosen: Sequence[int]) -> _Times:
    """Return milliseconds a frame of the stages in this process, on these cores."""
    recording = open_recording(recording_path)
    assert recording.calibration_path is not None
    calibration = read_calibration(recording.calibration_path)
    remap = build_remap(calibration, SETTINGS.map_height)
    blocks = build_source_blocks(calibration, SETTINGS.plan.block_rows)
    picture_memory, memory = PictureMemory(), None
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir()
    cores, most = os.sched_getaffinity(0), numba.get_num_threads()
    os.sched_setaffinity(0, chosen)  # for the decoders' threads too
    numba.set_num_threads(min(len(chosen), most))
    start_s = start_cpu_s = 0.0
    for position in range(-1, FRAMES):
        if position == 0:
            start_s, start_cpu_s = time.perf_counter(), time.process_time()
        bracket = recording.read_bracket(max(position, 0))
        image = merge_bracket(bracket, recording.sensor, picture_memory)
        environment = apply_remap(remap, image)
        view = apply_source_blocks(blocks, image)
        lights, memory = next_lights(
            view, SETTINGS.plan, memory, timestamp_s=bracket.timestamp_s, source="a frame"
        )
        write_environment(output / f"{position}.exr", environment)
        write_lights(output / f"{position}.json", lights, force=True)
    numba.set_num_threads(most)
    os.sched_setaffinity(0, cores)
    return _Times(
        1e3 * (time.perf_counter() - start_s) / FRAMES,
        1e3 * (time.process_time() - start_cpu_s) / FRAMES,
    )


def _timed_batch(recording: Path, warming: Path, output: Path, workers: int) -> _Times:
    """Return milliseconds a frame of processes that have seen a few frames before."""
    shutil.rmtree(output, ignore_errors=True)
    with connected(None, workers) as client:
        address = client.scheduler.address
        run_batch([warming], output / "warming", SETTINGS, scheduler=address, run_length=1)
        start_s, start_cpu_s = time.perf_counter(), _cpu_s(client)
        summary = run_batch([recording], output / "timed", SETTINGS, scheduler=address)
        wall_s, cpu_s = time.perf_counter() - start_s, _cpu_s(client) - start_cpu_s
    if summary.made != FRAMES:
        raise AssertionError(summary)
    return _Times(1e3 * wall_s / FRAMES, 1e3 * cpu_s / FRAMES)


def _cpu_s(client: Client) -> float:
    """Return the CPU time of this process and of all workers."""
    return time.process_time() + sum(client.run(time.process_time).values())
