"""The whole loop: brackets come in, pictures for a display go out.

Case : 3 JPEG exposures of 1024² px → 64 lights, and the map behind them → 640×480 picture of the
default scene, before a camera that stands, under a sky that turns by 1° a second, 30 brackets a
second. `ms` is per bracket of a stream of them, "CPU ms" what all cores spent on one, whoever else
is at work; the latency is from the first byte of a bracket to its picture, what it waited for the
one before it included. "files" writes each bracket's map, lights and pictures, and the video, as
`fishlight replay` does.
"""

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from calibration.files import read_calibration
from capture.frame import Bracket
from capture.merge import merge_bracket
from capture.picture_memory import PictureMemory
from capture.radiance import RadianceImage
from capture.recording import Recording
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.maps.remap import apply_remap, build_remap
from lighting.reduce import ADAPTIVE
from lighting.stream.light_stream import LightPlan, StreamMemory, next_lights
from render.baked.renderer import BakedRenderer
from render.output.view import to_display
from render.replay_folder import ReplayFolder
from render.scenes.default_scene import default_scene
from render.session import END_TO_END, Counters, StageClock, run_session
from tests.benchmarks.pipeline import COUNT, MAP_HEIGHT, recording_of_a_turning_sky

BRACKETS = 30
RATE_HZ = 30.0
TURN_RAD_PER_S = 0.0175


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row for pictures alone and one for all files; a stream takes seconds."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        recording = recording_of_a_turning_sky(
            Path(folder) / "sky", BRACKETS, TURN_RAD_PER_S, RATE_HZ
        )
        scene, camera = default_scene()
        with BakedRenderer(scene, camera) as renderer:
            for system, output in (("pictures", None), ("files", Path(folder) / "out")):
                clocks = [
                    _stream(recording, renderer, camera.size_px, output)
                    for _ in range(max(repeats // 3, 2))
                ][1:]
                bracket_ms = statistics.median(elapsed_ms for elapsed_ms, _, _ in clocks)
                frames = [frame for _, _, clock in clocks for frame in clock.frames]
                accuracy = {"brackets a second": 1e3 / bracket_ms}
                accuracy["CPU ms"] = min(cpu_ms for _, cpu_ms, _ in clocks)
                for stage, name in ((END_TO_END, "latency ms"), ("render", "render ms")):
                    accuracy[name] = statistics.median(frame[stage] for frame in frames)
                rows.append(
                    {
                        "stage": "loop",
                        "case": "3 × 1024² JPEG to 640×480",
                        "system": f"fishlight, {system}",
                        "ms": bracket_ms,
                        "accuracy": accuracy,
                    }
                )
    return rows


def _stream(
    recording: Recording, renderer: BakedRenderer, size_px: tuple[int, int], output: Path | None
) -> tuple[float, float, StageClock]:
    """Return milliseconds per bracket, of time and of all cores, and the session's clock."""
    assert recording.calibration_path is not None
    calibration = read_calibration(recording.calibration_path)
    plan = LightPlan(COUNT, ADAPTIVE)
    remap = build_remap(calibration, MAP_HEIGHT)
    blocks = build_source_blocks(calibration, plan.block_rows)
    pictures = PictureMemory()
    memory: StreamMemory | None = None

    def prepare(bracket: Bracket, _clock: StageClock) -> tuple[Bracket, RadianceImage, BlockSums]:
        image = merge_bracket(bracket, recording.sensor, pictures, is_beside=True)
        return bracket, image, apply_source_blocks(blocks, image, is_beside=True)

    def process(
        item: tuple[Bracket, RadianceImage, BlockSums], clock: StageClock, _counters: Counters
    ) -> None:
        nonlocal memory
        bracket, image, view = item
        lights, memory = next_lights(view, plan, memory, timestamp_s=bracket.timestamp_s)
        seen = apply_remap(remap, image)
        with clock.stage("render"):
            radiance = renderer.render(lights, seen)
        if folder is None:
            to_display(radiance, 0.0)
        else:
            folder.write(bracket.index, seen, lights, radiance)

    folder = None if output is None else ReplayFolder(output, size_px, RATE_HZ)
    start_s, start_cpu_s = time.perf_counter(), time.process_time()
    if folder is None:
        _, clock = run_session(recording, process, prepare=prepare)
    else:
        with folder:
            _, clock = run_session(recording, process, prepare=prepare)
    elapsed_s, cpu_s = time.perf_counter() - start_s, time.process_time() - start_cpu_s
    return 1e3 * elapsed_s / len(recording), 1e3 * cpu_s / len(recording), clock
