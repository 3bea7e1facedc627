"""What is done with the emulated camera inside the guest: python -m tests.camera.camera_schedule.

Each step's outcome is a line of report.jsonl in the folder given, and recordings lie beside it.
Whether they are right is judged outside (test_camera_in_guest.py), where arithmetic is fast.
Python starts and imports slowly here: all steps share one process, and commands run in its forks.
"""

import json
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from capture.errors import FishlightError
from capture.v4l2.camera import BracketCamera, CameraRequest, open_camera
from capture.v4l2.controls import list_controls, write_control
from capture.v4l2.node import VideoNode
from render.main import main
from tests.camera.camera_process import CameraProcess, wait_for_node
from tests.camera.uvc_stamp import stamp_of_data

TIMES_S = (0.001, 0.005, 0.02)
BRACKETS = 8
PAUSE_S = 1.0
_EXPOSURE_ABSOLUTE = 0x9A0902

Outcome = dict[str, Any]


def set_exposure_in_automatic_mode() -> Outcome:
    """Set an exposure time while the camera chooses its own, as it does when it is plugged in."""
    with VideoNode(wait_for_node()) as node:
        control = list_controls(node)[_EXPOSURE_ABSOLUTE]
        try:
            write_control(node, control, 100)
        except FishlightError as error:
            return {"refusal": described(error)}
    return {"refusal": None}


def take_brackets(pixel_format: str) -> Outcome:
    """Take brackets one after the other, pause until the queue is stale, and take another."""
    with opened(pixel_format) as camera:
        started_s = time.monotonic()
        brackets = [bracket_facts(camera) for _ in range(BRACKETS)]
        duration_s = time.monotonic() - started_s
        time.sleep(PAUSE_S)
        resumed_s = time.monotonic()
        after_pause = bracket_facts(camera)
        return {
            "brackets": brackets,
            "brackets_per_s": BRACKETS / duration_s,
            "resumed_s": resumed_s,
            "after_pause": after_pause,
            "counters": vars(camera.counters),
        }


def meet_faults(process: CameraProcess) -> Outcome:
    """Send a corrupt frame, stall, go on, be unplugged, and be plugged in again."""
    outcome: Outcome = {}
    with opened("MJPG") as camera:
        process.tell("corrupt")
        outcome["corrupt"] = errors_of(3, lambda: camera.capture(TIMES_S))
        outcome["counters"] = vars(camera.counters).copy()
        process.tell("stall")
        started_s = time.monotonic()
        outcome["stall"] = errors_of(1, lambda: camera.capture(TIMES_S))
        outcome["stall_s"] = time.monotonic() - started_s
    process.tell("resume")
    with opened("MJPG") as camera:
        outcome["resumed"] = bracket_facts(camera)
        process.tell("unplug")
        started_s = time.monotonic()
        outcome["unplug"] = errors_of(1, lambda: camera.capture(TIMES_S))
        outcome["unplug_s"] = time.monotonic() - started_s
    process.tell("plug")
    with opened("MJPG") as camera:
        outcome["replugged"] = [bracket_facts(camera) for _ in range(2)]
    return outcome


def record_to_the_end(share: Path, pixel_format: str) -> Outcome:
    """Record a number of brackets."""
    name = f"recorded-{pixel_format}"
    recorder = start_recording(share, name, pixel_format, "--brackets", str(BRACKETS))
    return {"status": os.waitstatus_to_exitcode(os.waitpid(recorder, 0)[1])}


def record_until_killed(share: Path, pixel_format: str) -> Outcome:
    """Record until two brackets are on the disk, and kill the recorder."""
    name = f"killed-{pixel_format}"
    recorder = start_recording(share, name, pixel_format, "--duration-s", "60")
    journal = share / name / "frames.jsonl"
    while not journal.exists() or journal.read_bytes().count(b"\n") < 2 * len(TIMES_S):
        if os.waitpid(recorder, os.WNOHANG) != (0, 0):
            raise RuntimeError("the recorder ended by itself")
        time.sleep(0.05)
    os.kill(recorder, signal.SIGKILL)
    return {"status": os.waitstatus_to_exitcode(os.waitpid(recorder, 0)[1])}


def start_recording(share: Path, name: str, pixel_format: str, *arguments: str) -> int:
    """Start `fishlight record` in a fork of this process, and return its id."""
    child = os.fork()
    if child:
        return child
    exposures = ",".join(map(str, TIMES_S))
    options = ["--exposures", exposures, "--format", pixel_format, "--rate", "30"]
    status: object = 1
    try:
        with (share / f"{name}.log").open("w") as log:
            os.dup2(log.fileno(), sys.stdout.fileno())
            os.dup2(log.fileno(), sys.stderr.fileno())
        main(["record", str(wait_for_node()), str(share / name), *options, *arguments])
        status = 0
    except SystemExit as end:
        status = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(status if isinstance(status, int) else 1)


def opened(pixel_format: str) -> BracketCamera:
    """Return the camera, at its highest rate in this format."""
    return open_camera(CameraRequest(str(wait_for_node()), None, pixel_format, 30.0))


def bracket_facts(camera: BracketCamera) -> list[Outcome]:
    """Take a bracket and return, of each frame, what is said of it and what it bears."""
    return [
        {
            "time_s": frame.exposure.time_s,
            "gain": frame.exposure.gain,
            "timestamp_s": frame.timestamp_s,
            "stamp": stamp_of_data(frame.data, camera.pixel_format, camera.size_px[0]),
        }
        for frame in camera.capture_undecoded(TIMES_S)
    ]


def errors_of(attempts: int, action: Callable[[], object]) -> list[str | None]:
    """Return what each attempt at something raised, None where it went well."""
    found: list[str | None] = []
    for _ in range(attempts):
        try:
            action()
            found.append(None)
        except FishlightError as error:
            found.append(described(error))
    return found


def described(error: BaseException) -> str:
    """Return an error's type and message."""
    return f"{type(error).__name__}: {error}"


def run(share: Path) -> None:
    """Run every step; one that fails is reported, and the next one is taken all the same."""
    with (
        CameraProcess(share / "pictures", share / "camera.jsonl") as process,
        (share / "report.jsonl").open("w", buffering=1) as report,
    ):
        process.tell("plug")
        steps: dict[str, Callable[[], Outcome]] = {
            "automatic": set_exposure_in_automatic_mode,
            "YUYV": partial(take_brackets, "YUYV"),
            "RG16": partial(take_brackets, "RG16"),
            "MJPG": partial(take_brackets, "MJPG"),
            "faults": partial(meet_faults, process),
            "record YUYV": partial(record_to_the_end, share, "YUYV"),
            "record MJPG": partial(record_to_the_end, share, "MJPG"),
            "kill RG16": partial(record_until_killed, share, "RG16"),
        }
        for name, step in steps.items():
            started_s = time.monotonic()
            outcome: Outcome = {"step": name}
            try:
                outcome |= step()
            except Exception as error:
                outcome["error"] = described(error)
            outcome["duration_s"] = time.monotonic() - started_s
            report.write(json.dumps(outcome) + "\n")


if __name__ == "__main__":
    run(Path(sys.argv[1]))
