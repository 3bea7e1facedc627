"""The emulated camera as a program that runs beside a test, in the guest."""

import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.camera.uvc_camera import NAME

_SYSFS = Path("/sys/class/video4linux")


class CameraProcess:
    """The camera's process, which ends with the `with` block and then writes its log."""

    def __init__(self, pictures: Path, log: Path) -> None:
        command = [sys.executable, "-S", "-m", "tests.camera.uvc_camera", str(pictures), str(log)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def tell(self, command: str) -> None:
        """Give one of the commands of uvc_camera.py and wait until it is done."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()
        if self._process.stdout.readline() != "ok\n":
            raise RuntimeError(f"the emulated camera could not {command}")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.communicate()  # closes its input


def wait_for_node(limit_s: float = 20.0) -> Path:
    """Return the device node of the plugged-in camera as soon as it can be opened."""
    end_s = time.monotonic() + limit_s
    while time.monotonic() < end_s:
        for folder in _SYSFS.glob("video*"):
            name = (folder / "name").read_text()
            is_first = (folder / "index").read_text().strip() == "0"  # the other holds metadata
            node = Path("/dev") / folder.name
            if is_first and name.startswith(NAME) and node.is_char_device():
                return node
        time.sleep(0.02)
    raise TimeoutError("the kernel has made no device of the emulated camera")
