"""The whole way of one bracket, stage by stage, as a session takes it.

Case : 3 JPEG exposures of 1024² px → 1024×512 map → 64 lights → 640×480 picture of the default
scene, every frame another bracket, so that every light moves and every shadow map is drawn anew.
Peer : OpenCV decoding, MergeRobertson with the true response and remap with cached maps; the
plain median cut of lighting/measures/peers.py. There is none for the picture.

`pipelined` is milliseconds per bracket of a stream of them, and how many a second that is: the
session's thread brings brackets in while this one merges and reduces them, from counts in memory,
as a camera delivers them, and from JPEG files. "to lights, through a map" reduces a 1024×512 map,
"to lights, at the source" sums the picture's pixels over blocks and needs none, "to a map" ends
with the map.
"""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calibration.camera import UP, Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from capture.frame import Bracket
from capture.merge import merge_bracket
from capture.picture_memory import PictureMemory
from capture.radiance import RadianceImage
from capture.recording import Recording, open_recording
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.remap import apply_remap, build_remap
from lighting.measures.peers import median_cut
from lighting.methods.adaptive import Memory
from lighting.reduce import most_block_rows, reduce_next
from lighting.simulation.scenario import scenario
from lighting.simulation.simulate import simulate_recording
from lighting.sphere.latlong import cell_directions
from render.baked.renderer import BakedRenderer
from render.scenes.default_scene import default_scene
from render.session import run_session
from tests.environments import environment, outdoors

SIZE = 1024
MAP_HEIGHT = 512
COUNT = 64
BRACKETS = 4
STREAM_BRACKETS = 16
EXPOSURES_S = (1 / 4000, 1 / 250, 1 / 16)
CAMERA = Calibration(Equidistant(((SIZE - 1) / 2,) * 2, SIZE / np.pi), (SIZE,) * 2, np.pi / 2, UP)
CASE = "3 × 1024² JPEG → 1024×512 → 64 lights → 640×480"

Times = dict[str, list[float]]
Stages = Callable[[RadianceImage], Any]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row per stage and system, and one for capture to lights."""
    with tempfile.TemporaryDirectory() as folder:
        recording = recording_of_a_turning_sky(Path(folder), BRACKETS, 0.2, 2.0)
        systems: dict[str, Callable[[int], Times]] = {
            "fishlight": _ours(recording),
            "OpenCV + median cut": _peer(recording),
        }
        streams = _streams(recording)
        times: dict[str, Times] = {name: {} for name in systems}
        for repeat in range(-1, repeats):
            for name, system in systems.items():
                for stage, samples_ms in system(repeat % BRACKETS).items():
                    if repeat >= 0:
                        times[name].setdefault(stage, []).extend(samples_ms)
        stream_ms = _alternating_medians(streams, repeats)
    medians = {
        name: {stage: statistics.median(ms) for stage, ms in stages.items()}
        for name, stages in times.items()
    }
    for stages in medians.values():
        to_lights = [stages[stage] for stage in ("decode", "merge", "remap", "lights")]
        stages["capture to lights"] = sum(to_lights)
    ours = medians["fishlight"]
    rows = [
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
    return rows + [
        {
            "stage": "pipeline",
            "case": case,
            "system": system,
            "ms": per_bracket_ms,
            "accuracy": {"brackets a second": 1e3 / per_bracket_ms},
        }
        for (case, system), per_bracket_ms in stream_ms.items()
    ]


def recording_of_a_turning_sky(
    folder: Path, brackets: int, turn_rad_per_s: float, rate_hz: float
) -> Recording:
    """Return a recording that is made in a folder."""
    folder.mkdir(exist_ok=True)
    calibration_path = folder / "calibration.json"
    write_calibration(calibration_path, CAMERA)
    moments = scenario(
        [outdoors(256)], bracket_count=brackets, rate_hz=rate_hz, yaw_rad_per_s=turn_rad_per_s
    )
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
    renderer = BakedRenderer(*default_scene())
    memory, reduce = PictureMemory(), _Reduction()

    def one_bracket(position: int) -> Times:
        times: Times = {}
        bracket: Bracket = _timed(times, "decode", lambda: recording.read_bracket(position))
        image = _timed(times, "merge", lambda: merge_bracket(bracket, recording.sensor, memory))
        seen = _timed(times, "remap", lambda: apply_remap(remap, image))
        lights = _timed(times, "lights", lambda: reduce(seen))
        _timed(times, "render", lambda: renderer.render(lights, seen))
        return times

    return one_bracket


class _Reduction:
    """The default reduction, which remembers the frame before."""

    def __init__(self) -> None:
        self._memory: Memory | None = None

    def __call__(self, view: EnvironmentMap | BlockSums) -> LightSet:
        lights, self._memory = reduce_next(view, COUNT, memory=self._memory)
        return lights


class _Stream:
    """Brackets over and over, as many as STREAM_BRACKETS."""

    def __init__(self, bracket_at: Callable[[int], Bracket]) -> None:
        self._bracket_at = bracket_at

    def __iter__(self) -> Iterator[Bracket]:
        return (self._bracket_at(index % BRACKETS) for index in range(STREAM_BRACKETS))


def _streams(recording: Recording) -> dict[tuple[str, str], Callable[[], Any]]:
    """Return sessions of STREAM_BRACKETS by (case, system)."""
    remap = build_remap(CAMERA, MAP_HEIGHT)
    source_blocks = build_source_blocks(CAMERA, most_block_rows(COUNT))
    in_memory = [recording.read_bracket(position) for position in range(BRACKETS)]

    def to_a_map(image: RadianceImage) -> Any:
        return apply_remap(remap, image)

    def through_a_map() -> Stages:
        reduce = _Reduction()
        return lambda image: reduce(apply_remap(remap, image))

    def at_the_source() -> Stages:
        reduce = _Reduction()
        return lambda image: reduce(apply_source_blocks(source_blocks, image))

    def session(stream: _Stream, stages: Stages) -> Callable[[], Any]:
        memory = PictureMemory()
        return lambda: run_session(
            stream, lambda bracket, *_: stages(merge_bracket(bracket, recording.sensor, memory))
        )

    return {
        (f"pipelined, {kind} to {end}", f"fishlight{way}"): session(_Stream(bracket_at), stages)
        for kind, bracket_at in (
            ("counts", in_memory.__getitem__),
            ("JPEG", recording.read_bracket),
        )
        for end, way, stages in (
            ("lights", ", at the source", at_the_source()),
            ("lights", ", through a map", through_a_map()),
            ("a map", "", to_a_map),
        )
    }


def _alternating_medians(
    streams: dict[tuple[str, str], Callable[[], Any]], repeats: int
) -> dict[tuple[str, str], float]:
    """Return milliseconds per bracket; the sessions take turns."""
    times: Times = {}
    samples: dict[tuple[str, str], list[float]] = {key: [] for key in streams}
    for repeat in range(-1, repeats):
        for key, stream in streams.items():
            _timed(times, "stream", stream)
            if repeat >= 0:
                samples[key].append(times["stream"][-1] / STREAM_BRACKETS)
    return {key: statistics.median(ms) for key, ms in samples.items()}


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
