"""Replay a recording: every bracket becomes a map, a set of lights and a picture, in order.

Input  : a recording's folder.
Output : a folder with maps/*.exr (and *.png to look at), lights/*.json, pictures/*.png, video.mp4
and session.json.
Cost   : per bracket, see `fishlight replay --timings`; the remap operator is built once.
Fails  : a bracket that cannot be read holds the picture of the one before it in the video, and is
         counted; no map, lights or picture are written for it. Nothing is written, and no earlier
         replay removed, before the first bracket has become a picture.
"""

import shutil
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.files import read_calibration
from capture.errors import InputError, UnreadableFrame
from capture.frame import Bracket
from capture.merge import merge_bracket
from capture.output import PARTIAL_PREFIX, write_json
from capture.picture_memory import PictureMemory
from capture.pictures import write_png
from capture.progress import progress
from capture.recording import Recording, open_recording
from lighting.environment_files import write_environment
from lighting.light_files import write_lights
from lighting.reduce import reduce_to_lights
from lighting.remap import apply_remap, build_remap
from render.gl import create_context, describe
from render.preview import preview
from render.renderer import Renderer
from render.scene import Camera, Scene
from render.session import Counters, StageClock, run_session
from render.video import VideoWriter
from render.view import auto_exposure_ev, to_display

SESSION_FILE = "session.json"
RESULT_NAMES = ("maps", "lights", "pictures", "video.mp4", SESSION_FILE)
CAPTURE_TO_LIGHTS = ("decode", "merge", "remap", "lights")
FALLBACK_RATE_HZ = 25.0


@dataclass(frozen=True)
class ReplaySummary:
    """What a replay did.

    Attributes
    ----------
    counters : Counters
    clock : StageClock
    gl : str
        Renderer and version of the OpenGL context.
    clipped_count : int
        Brackets with light that was clipped in every exposure: their lights are a lower bound.
    failures : tuple of str
        One line for each bracket that could not be read.
    """

    counters: Counters
    clock: StageClock
    gl: str
    clipped_count: int
    failures: tuple[str, ...]


def replay(
    recording_folder: Path,
    output: Path,
    *,
    scene: Scene,
    camera: Camera,
    count: int = 64,
    method: str = "inverse-cdf",
    map_height: int = 512,
    calibration_path: Path | None = None,
    force: bool = False,
) -> ReplaySummary:
    """Take every bracket of a recording to a map, lights and a picture in `output`.

    Parameters
    ----------
    recording_folder : Path
        A folder with a manifest.json.
    output : Path
        Folder for the results; made if it does not exist.
    scene, camera : Scene, Camera
        What is rendered, and from where.
    count : int
        Lights per bracket.
    method : str
        Name of the light reduction, a key of lighting.reduce.METHODS.
    map_height : int
        Rows N of the N × 2N maps.
    calibration_path : Path or None
        Calibration to use instead of the recording's own.
    force : bool
        Replace the results of an earlier replay in `output`.

    Raises
    ------
    InputError
        If the recording or calibration cannot be used, none of its brackets can be read, or
        `output` holds something else.
    GlUnavailable
        If there is no OpenGL context.
    """
    recording = open_recording(recording_folder)
    calibration = _calibration(recording, calibration_path)
    check_output(output, force=force)
    remap = build_remap(calibration, map_height)
    source = progress(recording, "replay", len(recording))
    size_px, rate_hz = camera.size_px, frame_rate_hz(recording)
    failures: list[str] = []
    memory = PictureMemory()
    with ExitStack() as stack:
        context = stack.enter_context(create_context())
        renderer = stack.enter_context(Renderer(context, scene, camera))
        gl = describe(context)
        video: VideoWriter | None = None
        exposure_ev = 0.0
        last_picture: NDArray[np.uint8] | None = None
        clipped_count = 0

        def process(bracket: Bracket, clock: StageClock, counters: Counters) -> None:
            nonlocal clipped_count, exposure_ev, last_picture, video
            with clock.stage("merge"):
                image = merge_bracket(bracket, recording.sensor, memory)
            counters.merged += 1
            with clock.stage("remap"):
                environment = apply_remap(remap, image)
            with clock.stage("lights"):
                lights = reduce_to_lights(
                    environment,
                    count,
                    method,
                    timestamp_s=bracket.timestamp_s,
                    source=f"{recording_folder.name}, bracket {bracket.index}",
                )
            with clock.stage("render"):
                radiance = renderer.render(lights, environment)
            counters.rendered += 1
            clipped_count += lights.clipped_fraction > 0
            with clock.stage("write"):
                if video is None:
                    prepare_output(output)
                    # One for all pictures, so that a change of brightness can be seen.
                    exposure_ev = auto_exposure_ev(radiance)
                    video = stack.enter_context(VideoWriter(output / "video.mp4", size_px, rate_hz))
                last_picture = to_display(radiance, exposure_ev)
                video.write(last_picture)
                name = f"{bracket.index:06d}"
                write_environment(output / "maps" / f"{name}.exr", environment)
                write_png(
                    output / "maps" / f"{name}.png", preview(environment, lights, exposure_ev)
                )
                write_lights(output / "lights" / f"{name}.json", lights, force=True)
                write_png(output / "pictures" / f"{name}.png", last_picture)

        def on_failure(error: UnreadableFrame) -> None:
            failures.append(str(error))
            if video is not None and last_picture is not None:
                video.write(last_picture)

        counters, clock = run_session(source, process, on_failure=on_failure)
    if counters.rendered == 0:
        raise InputError(
            f"{recording_folder}: none of its {counters.captured} brackets is usable: {failures[0]}"
        )
    summary = ReplaySummary(counters, clock, gl, clipped_count, tuple(failures))
    _write_session(output, "complete", summary)
    return summary


def check_output(output: Path, *, force: bool) -> None:
    """Raise InputError unless the results of a replay may go to `output`.

    They may if it does not exist or is an empty folder, and with `force` if an earlier replay made
    it: that is told by its session.json.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; the results need a folder")
    if output.is_dir() and any(output.iterdir()):
        if not force:
            raise InputError(f"{output} is not empty; give --force to replace an earlier replay")
        if not (output / SESSION_FILE).is_file():
            raise InputError(
                f"{output} holds no {SESSION_FILE}, so no replay made it, and it is left alone"
            )


def prepare_output(output: Path) -> None:
    """Make the result folder, emptied of an earlier replay's results and of nothing else."""
    left_by_a_kill = output.glob(f"{PARTIAL_PREFIX}*")
    for path in (*(output / name for name in RESULT_NAMES), *left_by_a_kill):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    for name in ("maps", "lights", "pictures"):
        (output / name).mkdir(parents=True, exist_ok=True)
    _write_session(output, "running", None)


def frame_rate_hz(recording: Recording) -> float:
    """Brackets per second of a recording, 25 where its timestamps do not tell."""
    times_s = recording.bracket_timestamps_s
    duration_s = times_s[-1] - times_s[0]
    rate_hz = (len(times_s) - 1) / duration_s if duration_s > 0 else FALLBACK_RATE_HZ
    return float(np.clip(rate_hz, 1.0, 60.0))


def stage_times_ms(clock: StageClock) -> dict[str, dict[str, float]]:
    """Median, 95th percentile and first-frame milliseconds of each stage."""
    stages = dict.fromkeys(stage for frame in clock.frames for stage in frame)
    table = {}
    for stage in stages:
        times = np.array([frame[stage] for frame in clock.frames if stage in frame])
        table[stage] = {
            "median_ms": float(np.median(times)),
            "p95_ms": float(np.percentile(times, 95)),
            "first_ms": float(times[0]),
        }
    return table


def write_timings(path: Path, summary: ReplaySummary, *, force: bool = False) -> None:
    """Write what each frame cost in each stage as JSON."""
    content = {
        "gl": summary.gl,
        "stages": stage_times_ms(summary.clock),
        "frames": [
            {stage: round(ms, 3) for stage, ms in frame.items()} for frame in summary.clock.frames
        ],
    }
    write_json(path, content, force=force)


def _calibration(recording: Recording, path: Path | None) -> Calibration:
    path = path or recording.calibration_path
    if path is None:
        raise InputError(
            f"{recording.folder} names no calibration; give one with --calibration cal.json"
        )
    calibration = read_calibration(path)
    calibration.check_size(recording.size_px, str(recording.folder))
    return calibration


def _write_session(output: Path, status: str, summary: ReplaySummary | None) -> None:
    content: dict[str, object] = {"schema": "fishlight-session/1", "status": status}
    if summary is not None:
        content |= {
            "counters": vars(summary.counters),
            "clipped_brackets": summary.clipped_count,
            "failures": summary.failures,
            "gl": summary.gl,
        }
    write_json(output / SESSION_FILE, content)
