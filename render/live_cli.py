"""`fishlight live`: a camera's light while it changes, watched and steered from a browser."""

import math
import signal
import sys
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from capture.arguments import WholeNumber, parse_exposures, parse_size
from capture.errors import InputError
from capture.v4l2.camera import CameraRequest
from lighting.light_arguments import AUTO, DEFAULT_ERROR, Count, Error, MethodName, most_lights
from lighting.reduce import ADAPTIVE
from lighting.remap_cli import check_map_height
from render.live.access import LOOPBACK, Access, checked_origins
from render.live.blend import Blend
from render.live.blend_parts import PlacedSource
from render.live.desk import Desk
from render.live.models import load_models
from render.live.picture import LivePicture
from render.live.running import LiveRequest, Stop, run_live
from render.live.server import LiveServer
from render.live.settings import Settings, changed
from render.live.window import PictureWindow, has_desktop
from render.session import Counters

PORT = 8040


def live(
    source: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    calibration: Annotated[tuple[Path, ...], Parameter(negative=())] = (),
    blend: Annotated[bool, Parameter(negative=())] = False,
    place: Annotated[tuple[str, ...], Parameter(negative=(), allow_leading_hyphen=True)] = (),
    count: Count = 64,
    error: Error = None,
    method: MethodName = ADAPTIVE,
    fps: Annotated[float | None, Parameter(name=["--fps", "--frame-rate"])] = None,
    exposures: str | None = None,
    camera_size: str | None = None,
    format: str | None = None,
    rate: float | None = None,
    mains_hz: float | None = None,
    once: bool = False,
    mesh: Annotated[tuple[Path, ...], Parameter(negative=())] = (),
    size: str = "640x480",
    height: WholeNumber = 256,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("live-output"),
    host: str = LOOPBACK,
    port: WholeNumber = PORT,
    origin: Annotated[tuple[str, ...], Parameter(negative=())] = (),
    window: Annotated[bool, Parameter(negative=())] = False,
    headless: bool = False,
) -> None:
    """Turn a camera's light into lights and pictures as it comes, on a page to watch and steer it.

    The address that is printed opens the page; it holds a token, without which nothing is served.
    `fishlight follow` takes the same address. Ctrl-C ends the session.

    Parameters
    ----------
    source
        Path, number, name or id of a camera, or the folder of a recording, which is played at its
        own pace, over and over. Several with --blend.
    calibration
        The camera's cal.json; a recording's own if not given. With --blend one for each source, in
        the same order, or one for all.
    blend
        Blend the lights of several sources by where their cameras stand. One that is missing fades
        out, and in when it is back.
    place
        With --blend, where each camera stands in metres, x,y,z with y up; as often as there are
        sources. The scene stands at 0,0,0 until it is moved on the page.
    fps
        Hold so many frames a second: with fewer lights, and if that is not enough with a smaller
        picture.
    exposures
        Exposure times of a camera's brackets in seconds, such as 1/1000,1/60; chosen for the scene
        if not given.
    camera_size
        Size of a camera's pictures, WIDTHxHEIGHT; as it is set if not given.
    format
        A camera's pixel format, such as MJPG; as it is set if not given.
    rate
        Frames per second of a camera, the highest if not given; brackets per second of a recording,
        its own pace if not given.
    mains_hz
        Frequency of the mains that feed the lamps, 50, 60 or 0; looked for if not given.
    once
        Play a recording once.
    mesh
        OBJ, glTF, GLB or PLY to choose on the page; may be given several times.
    size
        Size of the rendered picture, WIDTHxHEIGHT.
    height
        Rows of the lat-long map, which is twice as wide.
    output
        Folder for snapshots, exports and recordings that are asked for on the page.
    host
        Address to listen on, so that other machines can connect: whoever has the printed address
        can watch and steer, and what is sent can be read on the way.
    port
        To listen on; 0 for any that is free.
    origin
        A page of another server that may follow the lights, such as http://localhost:5173.
    window
        Show the picture in a window, too, whose closing ends the session; needs moderngl-window.
    headless
        Open no browser, and end with an error where something is missing.
    """
    check_map_height(height)
    if not 0 <= port <= 65535:
        raise InputError(f"--port {port}: wanted 0 to 65535")
    _check_folder(output)
    if rate is not None and not 0 < rate <= 1000:
        raise InputError(f"--rate {rate:g}: wanted more than 0, and at most 1000")
    if mains_hz not in (None, 0.0, 50.0, 60.0):
        raise InputError(f"--mains-hz {mains_hz:g}: wanted 50, 60, or 0 for none")
    most_lights(count, error, method)  # refuses what does not go together
    is_auto = count == AUTO
    settings = changed(
        Settings(),
        {
            "method": method,
            "is_auto": is_auto,
            **({} if is_auto else {"count": count}),
            "error": DEFAULT_ERROR if error is None else error,
            "frame_rate_hz": fps,
            "exposures_s": None if exposures is None else list(parse_exposures(exposures)),
            **({"model": mesh[0].stem} if mesh else {}),
        },
    )
    access = Access(host, checked_origins(origin))
    camera_px = None if camera_size is None else parse_size(camera_size)
    requests = [
        LiveRequest(
            CameraRequest(each, camera_px, format, rate), path, mains_hz, once, height, output
        )
        for each, path in zip(source, _one_for_each(calibration, len(source)), strict=True)
    ]
    placed = _placed(requests, place) if blend else ()
    if not blend and (len(source) > 1 or place):
        raise InputError("several sources, or a --place, are for --blend")
    models = load_models(mesh)
    for note in models.notes:
        _say(note)
    desk = Desk(settings, models)
    picture_px = parse_size(size)
    with (
        PictureWindow(picture_px) if window else nullcontext() as shown,
        LivePicture(desk.models, picture_px) as picture,
        _stopped_by_signals() as stop,
        LiveServer(desk, access, port, on_defect=stop.set) as server,
    ):
        print(f"{server.address}\nCtrl-C ends the session.", flush=True)
        if not headless and not window and has_desktop():
            webbrowser.open(server.address_for_once())
        is_patient = not headless

        def run() -> Counters:
            if blend:
                return Blend(placed, desk, picture, output, _say).run(stop, is_patient=is_patient)
            return run_live(requests[0], desk, picture, stop, is_patient=is_patient, say=_say)

        counters = run() if shown is None else _run_beside(shown, run, desk, stop)
    print(
        f"brackets: {counters.captured} captured, {counters.replaced} replaced, "
        f"{counters.merged} merged, {counters.rendered} rendered, {counters.failed} failed"
    )


def _run_beside(
    window: PictureWindow, run: Callable[[], Counters], desk: Desk, stop: Stop
) -> Counters:
    """Run the session on a thread of its own: windows want the main one."""
    with ThreadPoolExecutor(1, "fishlight-session") as thread:
        running = thread.submit(run)
        try:
            window.show(desk, running.done)
        finally:
            stop.set()
    return running.result()


def _say(text: str) -> None:
    print(f"fishlight: {text}", file=sys.stderr, flush=True)


def _check_folder(output: Path) -> None:
    """Raise InputError unless results can be saved there when they are asked for."""
    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; name a folder")
    if not output.absolute().parent.is_dir():
        raise InputError(f"{output.parent} is not a folder; {output.name} cannot be made there")


def _one_for_each(calibrations: Sequence[Path], count: int) -> Sequence[Path | None]:
    if len(calibrations) not in (0, 1, count):
        raise InputError(
            f"{count} sources and {len(calibrations)} calibrations: give one for each source in "
            "the same order, one for all, or none"
        )
    if len(calibrations) == count:
        return calibrations
    return [calibrations[0] if calibrations else None] * count


def _placed(requests: Sequence[LiveRequest], places: Sequence[str]) -> Sequence[PlacedSource]:
    """Return the sources of a blend; each saves its recordings in a folder of its own."""
    if len(requests) < 2 or len(places) != len(requests):
        raise InputError(
            f"--blend: wanted at least 2 sources and a --place x,y,z for each, got {len(requests)} "
            f"and {len(places)}"
        )
    return [
        PlacedSource(replace(request, output=request.output / f"source-{number}"), _metres(place))
        for number, (request, place) in enumerate(zip(requests, places, strict=True), start=1)
    ]


def _metres(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--place {text}: wanted metres x,y,z such as 1.5,0,-2") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"--place {text}: wanted finite metres")
    return x, y, z


@contextmanager
def _stopped_by_signals() -> Iterator[Stop]:
    """Yield what Ctrl-C and SIGTERM set; a second one ends the program at once."""
    stop = Stop()
    older = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in older.items():
            signal.signal(number, handler)

    def on_signal(_number: int, _frame: object) -> None:
        stop.set()
        restore()

    for number in older:
        signal.signal(number, on_signal)
    try:
        yield stop
    finally:
        restore()
