"""A live camera that is opened again when it is unplugged or stalls, within a budget.

Input  : CameraRequest.    Output : whatever is asked of the camera; CameraAway while it is away.
Attempts come 1, 3, 7, 15 and 23 seconds after the loss. After five in any 60 seconds without
lasting success the camera is given up. Opening sets all its controls again.
Fails  : a camera named /dev/videoN that has no link in /dev/v4l/by-id may come back as another N.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from capture.errors import CameraLost, CameraStalled, InputError, UnreadableFrame
from capture.v4l2.camera import BracketCamera, CameraRequest, open_camera

MOST_OPENINGS = 5
WINDOW_S = 60.0
"""A camera is opened again at most so many times in so many seconds."""

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 8.0
"""Before the first attempt; each one after it waits twice as long, up to the longest."""

TICK_S = 0.5
"""While a camera is away, this is how often it is told."""

T = TypeVar("T")
Open = Callable[[CameraRequest], BracketCamera]


class CameraAway(UnreadableFrame):
    """No bracket for now: the camera is away and will be opened again. What was last seen is stale.

    Attributes
    ----------
    age_s : float
        Seconds since the last good bracket, or since the camera was opened.
    """

    def __init__(self, message: str, age_s: float) -> None:
        super().__init__(message)
        self.age_s = age_s


class ReopeningCamera:
    """A camera that outlives being unplugged; opened here, closed by `with`.

    To be used by one thread at a time.

    Attributes
    ----------
    first : BracketCamera
        As it was first opened; one that comes back must be like it.
    reopened_count : int
    """

    def __init__(
        self, request: CameraRequest, stopped: threading.Event, open_camera: Open = open_camera
    ) -> None:
        """Open the camera; errors of this first time are not waited out.

        Parameters
        ----------
        request : CameraRequest
        stopped : Event
            Ends a wait when it is set.
        open_camera : callable
        """
        self.first = open_camera(request)
        self.reopened_count = 0
        self._request = replace(
            request,
            device=_lasting_name(request.device),
            seen_dn=int(self.first.sensor.white_dn),
        )
        self._stopped = stopped
        self._open = open_camera
        self._camera: BracketCamera | None = self.first
        self._attempts_s: deque[float] = deque(maxlen=MOST_OPENINGS)
        self._failures = 0
        self._due_s = 0.0
        self._good_s = time.monotonic()
        self._trouble: Exception | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the camera; harmless if it is away."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def take(self, action: Callable[[BracketCamera], T]) -> T:
        """Return what `action` gets from the camera, opened again first if that is due.

        Raises
        ------
        CameraAway
            If there is no camera for now; within TICK_S, or after an attempt to open it (which
            takes seconds). Call again.
        UnreadableFrame
            As `action` raises it; call again.
        CameraLost
            If the camera did not come back, or was lost too often.
        InputError
            If what came back is not the same camera.
        """
        camera = self._camera or self._reopen()
        self._check_alike(camera)
        try:
            result = action(camera)
        except (CameraLost, CameraStalled) as error:
            self.close()
            self._failed(error)
            raise self._away() from error
        self._failures, self._good_s = 0, time.monotonic()
        return result

    def _reopen(self) -> BracketCamera:
        wait_s = max(self._due_s - time.monotonic(), 0.0)
        if self._stopped.wait(min(wait_s, TICK_S)) or wait_s > TICK_S:
            raise self._away()
        self._attempts_s.append(time.monotonic())
        try:
            camera = self._open(self._request)
        except (CameraLost, CameraStalled, InputError) as error:
            self._failed(error)
            raise self._away() from error
        self._camera = camera
        self.reopened_count += 1
        return camera

    def _failed(self, error: Exception) -> None:
        """Plan the next attempt; raise CameraLost if the budget is spent."""
        self._trouble = error
        now_s = time.monotonic()
        if len(self._attempts_s) == MOST_OPENINGS and now_s - self._attempts_s[0] < WINDOW_S:
            raise CameraLost(
                f"{self._request.device}: given up, opened again {MOST_OPENINGS} times within "
                f"{WINDOW_S:.0f} s; at last: {error}"
            ) from error
        self._due_s = now_s + min(FIRST_WAIT_S * 2.0**self._failures, LONGEST_WAIT_S)
        self._failures += 1

    def _away(self) -> CameraAway:
        age_s = time.monotonic() - self._good_s
        device, trouble = self._request.device, self._trouble
        return CameraAway(f"{device}: the last bracket is {age_s:.1f} s old; {trouble}", age_s)

    def _check_alike(self, camera: BracketCamera) -> None:
        first = self.first
        if (camera.name, camera.pixel_format, camera.size_px, camera.sensor.white_dn) != (
            first.name,
            first.pixel_format,
            first.size_px,
            first.sensor.white_dn,
        ):
            raise InputError(
                f"{self._request.device}: came back as {camera.name}, {camera.size_px} "
                f"{camera.pixel_format}; it was {first.name}, {first.size_px} {first.pixel_format}"
            )


def _lasting_name(device: str, devices: Path = Path("/dev")) -> str:
    """Return the link that leads to the camera even after it was unplugged, if there is one."""
    node = devices / f"video{device}" if device.isdecimal() else Path(device)
    links = sorted((devices / "v4l" / "by-id").glob("*"))
    return next((str(link) for link in links if link.resolve() == node.resolve()), device)
