"""Replay a recording: every bracket becomes a map, a set of lights and a picture, in order.

Input  : a recording's folder.
Output : a folder with maps/*.exr (and *.png to look at), lights/*.json, pictures/*.png, video.mp4
and session.json.
Cost   : per bracket, see `fishlight replay --timings`; the ways from a picture to a map and to
blocks are built once. A method that takes block sums gets them from the camera's picture, which
takes as long as to sum up the map: so the map is only for the background and for people.
Fails  : a bracket that cannot be read holds the picture of the one before it in the video, and is
         counted; no map, lights or picture are written for it, and the lights of the next one
         follow those of the one before it.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from calibration.camera import Calibration
from calibration.files import read_calibration
from capture.errors import InputError, UnreadableFrame
from capture.frame import Bracket
from capture.merge import merge_bracket
from capture.output import write_json
from capture.picture_memory import PictureMemory
from capture.progress import progress
from capture.radiance import RadianceImage
from capture.recording import Recording, open_recording
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.remap import apply_remap, build_remap
from lighting.photometry.albedo import GroundAlbedo, ground_albedo
from lighting.reduce import BLOCK_METHODS
from lighting.stream.light_stream import LightPlan, StreamMemory, next_lights
from render.frame_rate import FrameRate
from render.output.enlarging import enlarged
from render.replay_folder import ReplayFolder, check_output, write_session
from render.replay_pictures import OpenGLPictures, Picture, Pictures, RayPictures
from render.scenes.scene import Camera, Scene
from render.session import Counters, StageClock, run_session

FALLBACK_RATE_HZ = 25.0


@dataclass(frozen=True)
class ReplaySummary:
    """What a replay did.

    Attributes
    ----------
    counters : Counters
    clock : StageClock
    light_counts : tuple of int
        Lights that each bracket was reduced to.
    predicted_errors : tuple of float
        Of each bracket, if the method predicts them.
    drawn_px : tuple of (int, int)
        (width, height) in which each picture was drawn, to be enlarged if that is less than asked.
    drawn_with : str
        What drew the pictures, for people.
    clipped_count : int
        Brackets with light that was clipped in every exposure: their lights are a lower bound.
    failures : tuple of str
        One line for each bracket that could not be read.
    albedo : GroundAlbedo or None
        Of the ground that objects stand on, as the first map shows it; None where it does not, or
        is not shown through it.
    """

    counters: Counters
    clock: StageClock
    light_counts: tuple[int, ...]
    predicted_errors: tuple[float, ...]
    drawn_px: tuple[tuple[int, int], ...]
    drawn_with: str
    clipped_count: int
    failures: tuple[str, ...]
    albedo: GroundAlbedo | None

    @property
    def median_lights(self) -> float:
        """Median number of lights of a bracket."""
        return float(np.median(self.light_counts))

    @property
    def median_drawn_px(self) -> tuple[int, int]:
        """Median size in which a picture was drawn."""
        return sorted(self.drawn_px)[len(self.drawn_px) // 2]

    @property
    def median_predicted_error(self) -> float | None:
        """Median predicted error of a bracket; None if there is none."""
        return float(np.median(self.predicted_errors)) if self.predicted_errors else None


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A bracket as the session's thread takes it from the producer's."""

    bracket: Bracket
    image: RadianceImage
    sums: BlockSums | None


class _Named(NamedTuple):
    """What a picture was drawn from."""

    bracket_index: int
    environment: EnvironmentMap
    lights: LightSet


def replay(
    recording_folder: Path,
    output: Path,
    plan: LightPlan,
    *,
    scene: Scene,
    camera: Camera,
    map_height: int = 512,
    calibration_path: Path | None = None,
    frame_rate_hz: float | None = None,
    through_ground: bool = False,
    with_opengl: bool = False,
    force: bool = False,
) -> ReplaySummary:
    """Take every bracket of a recording to a map, lights and a picture in `output`.

    Parameters
    ----------
    recording_folder : Path
        A folder with a manifest.json.
    output : Path
        Folder for the results; made if it does not exist.
    plan : LightPlan
        What lights every bracket is to have.
    scene, camera : Scene, Camera
        What is rendered, and from where.
    map_height : int
        Rows N of the N × 2N maps.
    calibration_path : Path or None
        Calibration to use instead of the recording's own.
    frame_rate_hz : float or None
        As many brackets a second are to be merged, reduced and drawn: `plan` may then have fewer
        lights, and pictures may be drawn smaller.
    through_ground : bool
        Show the map through the ground, which then only carries shadows.
    with_opengl : bool
        Draw with OpenGL in place of rays.
    force : bool
        Replace the results of an earlier replay in `output`.

    Raises
    ------
    InputError
        If the recording or calibration cannot be used, none of its brackets can be read, or
        `output` holds something else; or if OpenGL is to show the map through the ground.
    GlUnavailable
        If there is no OpenGL to draw with.
    """
    if with_opengl and through_ground:
        raise InputError("a floor that only carries shadows is drawn with rays, not with OpenGL")
    check_output(output, force=force)
    rate = FrameRate(frame_rate_hz)
    cameras = cache(lambda size_px: replace(camera, size_px=size_px))
    recording = open_recording(recording_folder)
    calibration = _calibration(recording, calibration_path)
    remap = build_remap(calibration, map_height)
    source_blocks = (
        build_source_blocks(calibration, plan.block_rows) if plan.method in BLOCK_METHODS else None
    )
    source = progress(recording, "replay", len(recording))
    picture_memory = PictureMemory()
    memory: StreamMemory | None = None
    took_ms: float | None = None
    light_counts: list[int] = []
    predicted_errors: list[float] = []
    drawn_px: list[tuple[int, int]] = []
    clipped_count = 0
    failures: list[str] = []
    albedo: GroundAlbedo | None = None
    with (
        _pictures(
            scene, frame_rate_hz, with_opengl=with_opengl, through_ground=through_ground
        ) as pictures,
        ReplayFolder(output, camera.size_px, recorded_rate_hz(recording)) as folder,
    ):

        def prepare(bracket: Bracket, clock: StageClock) -> _Prepared:
            with clock.stage("merge"):
                image = merge_bracket(bracket, recording.sensor, picture_memory, is_beside=True)
            if source_blocks is None:
                return _Prepared(bracket, image, None)
            with clock.stage("blocks"):
                sums = apply_source_blocks(source_blocks, image, is_beside=True)
            return _Prepared(bracket, image, sums)

        def process(prepared: _Prepared, clock: StageClock, counters: Counters) -> None:
            nonlocal memory, took_ms, clipped_count, albedo
            bracket = prepared.bracket
            counters.merged += 1
            with clock.stage("remap"):
                environment = apply_remap(remap, prepared.image)
            if through_ground and counters.merged == 1:
                albedo = ground_albedo(environment)
            view: EnvironmentMap | BlockSums = environment
            if prepared.sums is not None:
                view = prepared.sums
            planned = rate.planned(plan)
            with clock.stage("lights"):
                lights, memory = next_lights(
                    view,
                    planned,
                    memory,
                    took_ms=took_ms,
                    timestamp_s=bracket.timestamp_s,
                    source=f"{recording_folder.name}, bracket {bracket.index}",
                )
            light_counts.append(memory.found)
            if lights.predicted_error is not None:
                predicted_errors.append(lights.predicted_error)
            clipped_count += bool(view.clipped.any())
            drawn_px.append(rate.size_px(camera.size_px))
            with clock.stage("render"):
                finished = pictures.draw(
                    _Named(bracket.index, environment, lights),
                    cameras(drawn_px[-1]),
                    lights,
                    environment,
                    clock,
                )
            counters.rendered += 1
            # These are done beside all else, as decoding is.
            rate.judge(clock.frames[-1] | {"merge": 0.0, "blocks": 0.0}, planned, memory)
            took_ms = clock.frames[-1]["lights"] + clock.frames[-1]["render"]
            with clock.stage("write"):
                write(finished)

        def write(finished: list[tuple[_Named, Picture]]) -> None:
            for named, drawn in finished:
                folder.write(*named, enlarged(drawn, camera.size_px))

        def on_failure(error: UnreadableFrame) -> None:
            failures.append(str(error))
            write(pictures.rest())
            folder.hold()

        counters, clock = run_session(source, process, prepare=prepare, on_failure=on_failure)
        write(pictures.rest())
    if counters.rendered == 0:
        raise InputError(
            f"{recording_folder}: not one bracket of {counters.captured} is usable: {failures[0]}"
        )
    summary = ReplaySummary(
        counters,
        clock,
        tuple(light_counts),
        tuple(predicted_errors),
        tuple(drawn_px),
        pictures.about,
        clipped_count,
        tuple(failures),
        albedo,
    )
    write_session(output, "complete", _account(summary))
    return summary


def _pictures(
    scene: Scene, frame_rate_hz: float | None, *, with_opengl: bool, through_ground: bool
) -> Pictures[_Named]:
    if with_opengl:
        return OpenGLPictures(scene, frame_rate_hz)
    return RayPictures(scene, through_ground=through_ground)


def recorded_rate_hz(recording: Recording) -> float:
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


def capture_to_lights_ms(clock: StageClock) -> float:
    """Sum of the medians of the stages that lights need."""
    times = stage_times_ms(clock)
    picture_to_light = "blocks" if "blocks" in times else "remap"
    return sum(times[name]["median_ms"] for name in ("decode", "merge", picture_to_light, "lights"))


def write_timings(path: Path, summary: ReplaySummary, *, force: bool = False) -> None:
    """Write what each frame cost in each stage as JSON."""
    content = {
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


def _account(summary: ReplaySummary) -> dict[str, Any]:
    return {
        "counters": vars(summary.counters),
        "median_lights": summary.median_lights,
        "drawn_px": summary.drawn_px,
        "drawn_with": summary.drawn_with,
        "median_predicted_error": summary.median_predicted_error,
        "clipped_brackets": summary.clipped_count,
        "failures": summary.failures,
        "ground_albedo": None if summary.albedo is None else summary.albedo.reflectance.tolist(),
    }
