"""`fishlight replay`: every bracket of a recording to a map, lights and a picture."""

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from capture.arguments import Output, WholeNumber, parse_size
from capture.errors import InputError
from capture.output import refuse_existing
from lighting.light_arguments import Count, Error, MethodName, most_lights
from lighting.reduce import ADAPTIVE
from lighting.remap_cli import check_map_height
from lighting.stream.light_stream import LightPlan
from render.render_cli import scene_to_render
from render.replay import (
    ReplaySummary,
    capture_to_lights_ms,
    replay,
    stage_times_ms,
    write_timings,
)
from render.replay_pictures import RayPictures

Steady = Annotated[bool, Parameter(negative="--no-steady")]


def replay_command(
    recording: Path,
    /,
    *,
    output: Output,
    count: Count = 64,
    error: Error = None,
    budget_ms: float | None = None,
    fps: float | None = None,
    method: MethodName = ADAPTIVE,
    steady: Steady = True,
    height: WholeNumber = 512,
    mesh: Path | None = None,
    size: str = "640x480",
    mixed_reality: Annotated[bool, Parameter(negative="")] = False,
    renderer: Literal["rays", "opengl"] = "rays",
    calibration: Path | None = None,
    timings: Path | None = None,
    force: bool = False,
) -> None:
    """Turn every bracket of a recording into a map, a set of lights and a picture.

    Parameters
    ----------
    recording
        Folder with a manifest.json, as `fishlight import` or `fishlight simulate` makes it.
    output
        Folder for maps (EXR), lights (JSON), pictures (PNG), video.mp4 and session.json.
    budget_ms
        With --count auto: no more lights than can be found and rendered in so many milliseconds.
        The lights then depend on how fast the machine is.
    fps
        Keep up with so many brackets a second: with fewer lights than --count, and if that is not
        enough with smaller pictures, which are enlarged. The results then depend on how fast the
        machine is. Files are written beside, and may take longer.
    steady
        Smooth what trembles from bracket to bracket, such as noise and mains ripple. Small changes
        are then late, nine tenths of them shown within 0.58 s; large ones are shown at once.
    height
        Rows of the lat-long maps, which are twice as wide.
    mesh
        OBJ, glTF, GLB or PLY to render; a few objects that show the lights if not given.
    size
        Size of the pictures, WIDTHxHEIGHT.
    mixed_reality
        Stand the objects in the room: in place of the grey ground the floor that the camera saw
        carries their shadows and lights them from below, and mirrors show it.
    renderer
        rays trace what stands once, which takes seconds, and then draw fastest on a CPU; opengl
        draws at once, fast on a GPU, with softer reflections of objects.
    calibration
        Calibration to use instead of the recording's own.
    timings
        JSON file for what every frame cost in each stage.
    force
        Replace the results of an earlier replay.
    """
    check_map_height(height)
    if timings is not None:
        refuse_existing(timings, force=force)
        if timings.parent != output and not timings.parent.is_dir():
            raise InputError(f"{timings.parent} is not a folder; give --timings one that exists")
    if budget_ms is not None and isinstance(count, int):
        raise InputError("--budget-ms limits --count auto, and that was not given")
    if budget_ms is not None and fps is not None:
        raise InputError("--fps sets the budget of every frame; leave out --budget-ms")
    most, error = most_lights(count, error, method)
    plan = LightPlan(most, method, error, budget_ms, is_steady=steady)
    scene, camera = scene_to_render(mesh, parse_size(size))
    summary = replay(
        recording,
        output,
        plan,
        scene=scene,
        camera=camera,
        map_height=height,
        calibration_path=calibration,
        frame_rate_hz=fps,
        through_ground=mixed_reality,
        with_opengl=renderer == "opengl",
        force=force,
    )
    if timings is not None:
        write_timings(timings, summary, force=force)
    _report(summary, output)
    if mixed_reality:
        _report_ground(summary)
    if fps is not None:
        _report_choice(summary, fps, camera.size_px)


def _report(summary: ReplaySummary, output: Path) -> None:
    for failure in summary.failures:
        print(f"fishlight: left out: {failure}", file=sys.stderr)
    counters = summary.counters
    print(
        f"{output}: brackets: {counters.captured} captured, {counters.replaced} replaced, "
        f"{counters.merged} merged, {counters.rendered} rendered, {counters.failed} failed"
    )
    if summary.median_predicted_error is not None:
        print(
            f"median lights {summary.median_lights:g}, "
            f"predicted error {summary.median_predicted_error:.2%}"
        )
    if summary.clipped_count:
        print(
            f"brackets with light that was clipped in every exposure: {summary.clipped_count}; "
            "their lights are a lower bound (clipped_fraction in lights/*.json)"
        )
    times = stage_times_ms(summary.clock)
    if times:
        stages = ", ".join(f"{name} {stage['median_ms']:.1f}" for name, stage in times.items())
        to_lights_ms = capture_to_lights_ms(summary.clock)
        print(f"median ms: {stages}; capture to lights {to_lights_ms:.1f}")
    if summary.drawn_with != RayPictures.about:
        print(f"drawn with {summary.drawn_with}")


def _report_ground(summary: ReplaySummary) -> None:
    if summary.albedo is None:
        print("albedo of the ground: unknown, too little of it or of the sky was seen")
        return
    reflectance = " ".join(f"{share:.2f}" for share in summary.albedo.reflectance)
    seen = f"{summary.albedo.seen_share:.0%}"
    print(f"albedo of the ground: {reflectance}, of which {seen} was seen")


def _report_choice(summary: ReplaySummary, fps: float, asked_px: tuple[int, int]) -> None:
    drawn, asked = ("×".join(map(str, size)) for size in (summary.median_drawn_px, asked_px))
    enlarged = "" if drawn == asked else f", enlarged to {asked}"
    print(
        f"for {fps:g} brackets a second: median lights {summary.median_lights:g}, "
        f"pictures drawn in {drawn}{enlarged}"
    )
