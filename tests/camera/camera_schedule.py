"""What is done with the emulated camera inside the guest: python -m tests.camera.camera_schedule.

Each step's outcome is a line of report.jsonl in the folder given, and recordings lie beside it.
Whether they are right is judged outside (test_camera_in_guest.py), where arithmetic is fast.
Python starts and imports slowly here: all steps share one process, and commands run in its forks.
"""

import json
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from capture.errors import FishlightError
from capture.frame import Bracket
from capture.live_source import LiveSource
from capture.reopening import CameraAway
from capture.v4l2.camera import BracketCamera, CameraRequest, open_camera
from capture.v4l2.controls import list_controls, write_control
from capture.v4l2.node import VideoNode
from render.main import main
from tests.camera.camera_process import CameraProcess, wait_for_node
from tests.camera.uvc_stamp import stamp_of_data

TIMES_S = (0.001, 0.005, 0.02)
BRACKETS = 6
LIVE_BRACKETS = 3
PAUSE_S = 1.0

RATE_HZ = 20.0
"""Not the camera's highest: beside other tests the guest stands still for a frame's time."""

ATTEMPTS = 3
"""How often what may be tried again is tried: on a busy machine the guest stands still at times."""

_EXPOSURE_ABSOLUTE = 0x9A0902

Outcome = dict[str, Any]
Result = TypeVar("Result")


class Schedule:
    """The steps, and what they share."""

    def __init__(self, share: Path, process: CameraProcess) -> None:
        self._share = share
        self._process = process
        self._retries: list[str] = []
        self._memory = Path(tempfile.mkdtemp())

    def run(self) -> None:
        """Take every step; one that fails is reported, and the next one is taken all the same."""
        preload()
        self._process.tell("plug")
        steps: dict[str, Callable[[], Outcome]] = {
            "automatic": set_exposure_in_automatic_mode,
            "brackets": self._take_brackets,
            "faults": self._meet_faults,
            "recorded-YUYV": partial(self._record, "YUYV"),
            "replugged-MJPG": partial(self._record_through_replug, "MJPG"),
            "killed-RG16": partial(self._record_until_killed, "RG16"),
            "live-YUYV": partial(self._follow_through_replug, "YUYV"),
        }
        with (self._share / "report.jsonl").open("w", buffering=1) as report:
            for name, step in steps.items():
                started_s = time.monotonic()
                outcome: Outcome = {"step": name}
                try:
                    outcome |= step()
                except Exception:
                    outcome["error"] = traceback.format_exc()
                outcome |= {"retries": self._retries, "duration_s": time.monotonic() - started_s}
                self._retries = []
                report.write(json.dumps(outcome) + "\n")
                print(name, outcome.get("error", "done"), *outcome["retries"], flush=True)
        shutil.copytree(self._memory, self._share / "recordings")

    def _take_brackets(self) -> Outcome:
        """Take brackets one after the other, pause until the queue is stale, and take another."""
        with self._opened("RG16") as camera:
            started_s = time.monotonic()
            brackets = [self._bracket(camera) for _ in range(BRACKETS)]
            duration_s = time.monotonic() - started_s
            time.sleep(PAUSE_S)
            resumed_s = time.monotonic()
            return {
                "brackets": brackets,
                "brackets_per_s": BRACKETS / duration_s,
                "resumed_s": resumed_s,
                "after_pause": self._bracket(camera),
                "counters": vars(camera.counters),
                "settling": vars(camera.settling),
            }

    def _meet_faults(self) -> Outcome:
        """Send corrupt frames, stall, go on, and be unplugged."""
        outcome: Outcome = {}
        with self._opened("MJPG") as camera:
            self._bracket(camera)
            self._process.tell("corrupt")
            outcome["corrupt"] = error_of(camera.capture)
            outcome["counters"] = vars(camera.counters).copy()
            self._process.tell("mend")
            outcome["mended"] = self._bracket(camera)
            self._process.tell("stall")
            started_s = time.monotonic()
            outcome["stall"] = error_of(camera.capture)
            outcome["stall_s"] = time.monotonic() - started_s
        self._process.tell("resume")
        with self._opened("MJPG") as camera:
            outcome["resumed"] = self._bracket(camera)
            self._process.tell("unplug")
            started_s = time.monotonic()
            outcome["unplug"] = error_of(camera.capture)
            outcome["unplug_s"] = time.monotonic() - started_s
        self._process.tell("plug")
        return outcome

    def _record(self, pixel_format: str) -> Outcome:
        """Record a number of brackets."""
        name = f"recorded-{pixel_format}"
        recorder = self._start_recording(name, pixel_format, "--brackets", str(BRACKETS))
        return {"status": status_of(recorder)}

    def _record_through_replug(self, pixel_format: str) -> Outcome:
        """Record, and pull the plug for a second in between."""
        name = f"replugged-{pixel_format}"
        recorder = self._start_recording(name, pixel_format, "--brackets", str(2 * BRACKETS))
        self._wait_for_two_brackets(name, recorder)
        self._process.tell("unplug")
        time.sleep(PAUSE_S)
        self._process.tell("plug")
        return {"status": status_of(recorder)}

    def _record_until_killed(self, pixel_format: str) -> Outcome:
        """Record until two brackets are written, and kill the recorder."""
        name = f"killed-{pixel_format}"
        recorder = self._start_recording(name, pixel_format, "--duration-s", "60")
        self._wait_for_two_brackets(name, recorder)
        os.kill(recorder, signal.SIGKILL)
        return {"status": status_of(recorder)}

    def _follow_through_replug(self, pixel_format: str) -> Outcome:
        """Take brackets as a live session does, pull the plug in between, and keep what came."""
        folder = self._memory / "live"
        folder.mkdir()
        came: list[Outcome] = []
        brackets = away = 0
        request = CameraRequest(camera_name(), None, pixel_format, RATE_HZ)
        with LiveSource(request, exposures_s=TIMES_S) as source:
            for item in source:
                if isinstance(item, Bracket):
                    brackets += 1
                    np.save(folder / f"{len(came)}.npy", [frame.counts for frame in item.frames])
                    came.append({"times_s": [frame.exposure.time_s for frame in item.frames]})
                    if brackets == LIVE_BRACKETS:
                        self._process.tell("unplug")
                    elif brackets == 2 * LIVE_BRACKETS:
                        source.stop()
                else:
                    is_away = isinstance(item, CameraAway)
                    came.append({"error": str(item), "is_away": is_away})
                    away += is_away
                    if away == 2 and is_away:
                        self._process.tell("plug")
            return {"came": came, "reopened": source.reopened_count}

    def _wait_for_two_brackets(self, name: str, recorder: int) -> None:
        journal = self._memory / name / "frames.jsonl"
        while not journal.exists() or journal.read_bytes().count(b"\n") < 2 * len(TIMES_S):
            if os.waitpid(recorder, os.WNOHANG) != (0, 0):
                log = (self._memory / f"{name}.log").read_text()
                raise RuntimeError(f"the recorder ended by itself: {log}")
            time.sleep(0.02)

    def _start_recording(self, name: str, pixel_format: str, *arguments: str) -> int:
        """Start `fishlight record` in a fork of this process, and return its id."""
        child = os.fork()
        if child:
            return child
        exposures = ",".join(map(str, TIMES_S))
        options = ["--exposures", exposures, "--format", pixel_format, "--rate", f"{RATE_HZ:g}"]
        status: object = 1
        try:
            with (self._memory / f"{name}.log").open("w") as log:
                os.dup2(log.fileno(), sys.stdout.fileno())
                os.dup2(log.fileno(), sys.stderr.fileno())
            main(["record", camera_name(), str(self._memory / name), *options, *arguments])
            status = 0
        except SystemExit as end:
            status = end.code or 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(status if isinstance(status, int) else 1)

    def _opened(self, pixel_format: str) -> BracketCamera:
        """Return the camera, once it is there."""
        return self._patiently(
            lambda: open_camera(CameraRequest(str(wait_for_node()), None, pixel_format, RATE_HZ))
        )

    def _bracket(self, camera: BracketCamera) -> list[Outcome]:
        """Take a bracket and return, of each frame, what is said of it and what it bears."""
        return [
            {
                "time_s": frame.exposure.time_s,
                "gain": frame.exposure.gain,
                "timestamp_s": frame.timestamp_s,
                "stamp": stamp_of_data(frame.data, camera.pixel_format, camera.size_px[0]),
            }
            for frame in self._patiently(lambda: camera.capture_undecoded(TIMES_S))
        ]

    def _patiently(self, action: Callable[[], Result]) -> Result:
        for _ in range(ATTEMPTS - 1):
            try:
                return action()
            except FishlightError as error:
                self._retries.append(described(error))
        return action()


def preload() -> None:
    """Import what the forks will need, and read all that is mapped: nothing waits for files later.

    While the guest waits for the host, its clock leaps ahead.
    """
    for module in ("render.app", "capture.record_cli"):
        import_module(module)
    maps = Path("/proc/self/maps").read_text().splitlines()
    for name in {line.partition("/")[2] for line in maps} - {""}:
        Path("/", name).read_bytes()


def set_exposure_in_automatic_mode() -> Outcome:
    """Set an exposure time while the camera chooses its own, as it does when it is plugged in."""
    with VideoNode(wait_for_node()) as node:
        control = list_controls(node)[_EXPOSURE_ABSOLUTE]
        try:
            write_control(node, control, 100)
        except FishlightError as error:
            return {"refusal": described(error)}
    return {"refusal": None}


def camera_name() -> str:
    """Return what the kernel calls the camera; that stays when it is plugged in again."""
    return Path("/sys/class/video4linux", wait_for_node().name, "name").read_text().strip()


def status_of(child: int) -> int:
    """Wait for a fork to end and return its exit status, negative if a signal ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def error_of(capture: Callable[[Sequence[float]], object]) -> str | None:
    """Return what capturing raised, None if it went well."""
    try:
        capture(TIMES_S)
    except FishlightError as error:
        return described(error)
    return None


def described(error: BaseException) -> str:
    """Return an error's type and message."""
    return f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    with CameraProcess(folder / "pictures", folder / "camera.jsonl") as camera_process:
        Schedule(folder, camera_process).run()
