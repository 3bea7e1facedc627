"""The whole way of one bracket, stage by stage, as a session takes it.

Case : 3 JPEG exposures of 1024² px → 1024×512 map → 64 lights → 640×480 picture of the default
scene, every frame another bracket, so that every light moves and every shadow map is drawn anew.
Peer : OpenCV decoding, MergeRobertson with the true response and remap with cached maps; the
plain median cut of tests/benchmarks/lights.py. There is none for the picture.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calibration.camera import UP, Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from capture.frame import Bracket
from capture.merge import merge_bracket
from capture.recording import Recording, open_recording
from lighting.latlong import cell_directions
from lighting.reduce import reduce_to_lights
from lighting.remap import apply_remap, build_remap
from lighting.scenario import scenario
from lighting.simulate import simulate_recording
from render.default_scene import default_scene
from render.gl import create_context
from render.renderer import Renderer
from tests.benchmarks.lights import median_cut
from tests.environments import environment, outdoors

SIZE = 1024
MAP_HEIGHT = 512
COUNT = 64
BRACKETS = 4
EXPOSURES_S = (1 / 4000, 1 / 250, 1 / 16)
CAMERA = Calibration(Equidistant(((SIZE - 1) / 2,) * 2, SIZE / np.pi), (SIZE,) * 2, np.pi / 2, UP)
CASE = "3 × 1024² JPEG → 1024×512 → 64 lights → 640×480"

Times = dict[str, list[float]]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row per stage and system, and one for capture to lights."""
    with tempfile.TemporaryDirectory() as folder:
        recording = _recording(Path(folder))
        systems: dict[str, Callable[[int], Times]] = {
            "fishlight": _ours(recording),
            "OpenCV + median cut": _peer(recording),
        }
        times: dict[str, Times] = {name: {} for name in systems}
        for repeat in range(-1, repeats):
            for name, system in systems.items():
                for stage, ms in system(repeat % BRACKETS).items():
                    if repeat >= 0:
                        times[name].setdefault(stage, []).extend(ms)
    medians = {
        name: {stage: statistics.median(ms) for stage, ms in stages.items()}
        for name, stages in times.items()
    }
    for stages in medians.values():
        to_lights = [stages[stage] for stage in ("decode", "merge", "remap", "lights")]
        stages["capture to lights"] = sum(to_lights)
    ours = medians["fishlight"]
    return [
        {
            "stage": "pipeline",
            "case": stage,
            "system": name,
            "ms": ms,
            "ratio": ms / ours[stage],
            "accuracy": {},
        }
        for stage in ours
        for name, stages in medians.items()
        if (ms := stages.get(stage)) is not None
    ]


def _recording(folder: Path) -> Recording:
    """Return a recording of `BRACKETS` brackets of a turning sky."""
    calibration_path = folder / "calibration.json"
    write_calibration(calibration_path, CAMERA)
    moments = scenario([outdoors(256)], bracket_count=BRACKETS, rate_hz=2.0, yaw_rad_per_s=0.2)
    simulate_recording(
        folder / "recording",
        moments,
        calibration_path,
        exposures_s=EXPOSURES_S,
        source="simulated for the benchmark",
    )
    return open_recording(folder / "recording")


def _timed(times: Times, stage: str, action: Callable[[], Any]) -> Any:
    start_s = time.perf_counter()
    result = action()
    times.setdefault(stage, []).append(1e3 * (time.perf_counter() - start_s))
    return result


def _ours(recording: Recording) -> Callable[[int], Times]:
    remap = build_remap(CAMERA, MAP_HEIGHT)
    renderer = Renderer(create_context(), *default_scene())

    def one_bracket(position: int) -> Times:
        times: Times = {}
        bracket: Bracket = _timed(times, "decode", lambda: recording.read_bracket(position))
        image = _timed(times, "merge", lambda: merge_bracket(bracket, recording.sensor))
        seen = _timed(times, "remap", lambda: apply_remap(remap, image))
        lights = _timed(times, "lights", lambda: reduce_to_lights(seen, COUNT))
        _timed(times, "render", lambda: renderer.render(lights, seen))
        return times

    return one_bracket


def _peer(recording: Recording) -> Callable[[int], Times]:
    pixels, seen = CAMERA.project(cell_directions(MAP_HEIGHT))
    pixels[~seen] = -10
    x, y = np.moveaxis(pixels.astype(np.float32), -1, 0).copy()
    merge = cv2.createMergeRobertson()
    times_s = np.array(EXPOSURES_S, np.float32)
    response = recording.sensor.linear_table()[:, None, ::-1].copy()

    def one_bracket(position: int) -> Times:
        times: Times = {}
        paths = [str(recording.folder / frame.file) for frame in recording.brackets[position]]
        counts = _timed(times, "decode", lambda: [cv2.imread(path) for path in paths])
        radiance = _timed(times, "merge", lambda: merge.process(counts, times_s, response))
        latlong = _timed(times, "remap", lambda: cv2.remap(radiance, x, y, cv2.INTER_LINEAR))
        as_map = environment(np.nan_to_num(latlong[..., ::-1]))
        _timed(times, "lights", lambda: median_cut(as_map, COUNT))
        return times

    return one_bracket
