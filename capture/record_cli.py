"""`fishlight record`: a live camera's brackets, written as they come."""

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from capture.arguments import WholeNumber, parse_exposures, parse_size
from capture.errors import InputError
from capture.recorder import Length, Recorded, record
from capture.v4l2.camera import CameraRequest


def record_command(
    device: str,
    recording: Path,
    /,
    *,
    exposures: str | None = None,
    size: str | None = None,
    format: str | None = None,
    rate: float | None = None,
    brackets: WholeNumber | None = None,
    duration_s: float | None = None,
    mains_hz: float | None = None,
    calibration: Path | None = None,
    force: bool = False,
) -> None:
    """Record brackets from a camera until Ctrl-C, or for as long as is asked for.

    Parameters
    ----------
    device
        Path, number, id or a part of the name of a camera, such as /dev/video0 or a name in
        /dev/v4l/by-id, which finds it again after it was unplugged.
    recording
        Folder to be made.
    exposures
        Exposure times of a bracket in seconds, such as 1/1000,1/60. They are chosen for the scene,
        and follow it, if not given.
    size
        Size of the pictures, WIDTHxHEIGHT; as the camera is set if not given.
    format
        Pixel format, such as MJPG or YUYV; as the camera is set if not given.
    rate
        Frames per second; the highest if not given.
    brackets
        Stop after so many.
    duration_s
        Stop after so many seconds.
    mains_hz
        Frequency of the mains that feed the lamps, 50 or 60, so that exposures are whole numbers of
        their pulses; 0 for daylight. It is looked for in the pictures if not given.
    calibration
        The camera's cal.json, copied into the recording.
    force
        Replace the recording if it exists.
    """
    if mains_hz not in (None, 0.0, 50.0, 60.0):
        raise InputError(f"--mains-hz {mains_hz:g}: wanted 50, 60, or 0 for none")
    for name, value in (("brackets", brackets), ("duration-s", duration_s), ("rate", rate)):
        if value is not None and not value > 0:
            raise InputError(f"--{name} {value:g}: wanted more than 0")
    request = CameraRequest(device, None if size is None else parse_size(size), format, rate)
    exposures_s = None if exposures is None else parse_exposures(exposures)
    with _stopped_by_signals() as stopped, _progress(brackets) as show:
        recorded = record(
            request,
            recording,
            exposures_s=exposures_s,
            mains_hz=mains_hz,
            length=Length(brackets, duration_s),
            calibration=calibration,
            force=force,
            stopped=stopped,
            report=show,
        )
    print(f"{recording}: {_account(recorded)}")
    if recorded.ended_by is not None:
        raise recorded.ended_by


@contextmanager
def _stopped_by_signals() -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C or SIGTERM sets; a second one ends the program at once."""
    stopped = threading.Event()
    older = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def stop(_number: int, _frame: object) -> None:
        stopped.set()
        restore()

    def restore() -> None:
        for number, handler in older.items():
            signal.signal(number, handler)

    for number in older:
        signal.signal(number, stop)
    try:
        yield stopped
    finally:
        restore()


@contextmanager
def _progress(bracket_count: int | None) -> Iterator[Callable[[Recorded], None]]:
    """Yield what shows a recording's progress: a line on a terminal, nothing in a pipe."""
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
    ) as progress:
        task = progress.add_task("opening the camera", total=bracket_count)
        started_s: float | None = None

        def show(recorded: Recorded) -> None:
            nonlocal started_s
            now_s = time.monotonic()
            started_s = now_s if started_s is None else started_s
            rate_hz = recorded.captured / max(now_s - started_s, 1e-3)
            text = recorded.trouble or (
                f"{_counts(recorded)}; {rate_hz:.1f} a second; exposures {_times(recorded)}"
            )
            progress.update(task, completed=recorded.captured, description=text)

        yield show


def _account(recorded: Recorded) -> str:
    return (
        f"{_counts(recorded)}, frames {recorded.frames}, frames the camera lost {recorded.gaps}, "
        f"reopened {recorded.reopened_count}; last exposures {_times(recorded)}"
    )


def _counts(recorded: Recorded) -> str:
    lost = recorded.unreadable + recorded.damaged
    return f"brackets {recorded.written}, dropped {recorded.dropped}, unreadable {lost}"


def _times(recorded: Recorded) -> str:
    return ", ".join(f"{time_s:.4g}" for time_s in recorded.times_s) + " s"
