"""Between the session's thread and the server's: settings one way, frames the other.

The session reads `settings` and takes `requests`; it publishes frames. The server does the rest.
Nothing here waits: a slot holds the newest frame, and what nobody fetched is gone.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.live.models import Models
from render.live.settings import Settings, changed

Request = Literal["snapshot", "record", "export-usda", "export-glb", "export-py", "export-rad"]
"""What can be asked for beside settings; `record` begins or ends a recording."""

StateName = Literal[
    "starting", "running", "away", "no-camera", "calibration", "clipped", "dark", "ended"
]


@dataclass(frozen=True)
class State:
    """How the session is, with a line for people."""

    name: StateName
    message: str = ""


@dataclass(frozen=True)
class Notice:
    """An answer to a request, or why there is none; `number` tells one from the next."""

    number: int
    text: str
    is_error: bool = False


@dataclass(frozen=True, eq=False)
class Seen:
    """What a bracket showed: lights, and pictures for people. Nothing in it changes any more.

    Attributes
    ----------
    lights : LightSet
    camera : RadianceImage
        Thinned out.
    environment : EnvironmentMap or None
        None where nobody watches.
    picture : (H, W, 4) float32 or None
        Rendered radiance and alpha; None where nobody watches.
    view_ev : float
    is_draft : bool
        Whether the picture is to be replaced by a better one.
    """

    lights: LightSet
    camera: RadianceImage | None
    environment: EnvironmentMap | None
    picture: NDArray[np.float32] | None
    view_ev: float
    is_draft: bool


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """What is published: a moment of the session.

    Attributes
    ----------
    number : int
        Rises with each.
    state : State
    seen : Seen or None
        The newest there is; None before the first.
    age_s : float
        Of `seen`, when this was published: from the start of its exposure.
    published_s : float
        On time.monotonic's clock.
    account : mapping
        Numbers for people, as JSON has them.
    """

    number: int
    state: State
    seen: Seen | None
    age_s: float
    published_s: float
    account: Mapping[str, Any]


class Desk:
    """One for a session; any thread may call any method.

    Attributes
    ----------
    settings : Settings
        The newest.
    newest : LiveFrame or None
    notice : Notice or None
    watchers : int
        How many look at pictures.
    is_recording : bool
        Whether brackets are being recorded.
    on_change : callable
        Called, from whatever thread, when something was changed or asked for.
    """

    def __init__(self, settings: Settings, models: Models) -> None:
        models.check(settings)
        self.models = models
        self.settings = settings
        self.newest: LiveFrame | None = None
        self.notice: Notice | None = None
        self.watchers = 0
        self.is_recording = False
        self._requests: list[Request] = []
        self.on_change: Callable[[], None] = lambda: None
        self._listeners: list[Callable[[], None]] = []
        self._lock = threading.Lock()

    def listen(self, listener: Callable[[], None]) -> None:
        """Have `listener` called, from whatever thread, when there is something new."""
        self._listeners.append(listener)

    @property
    def is_watched(self) -> bool:
        """Whether anybody looks at pictures."""
        return self.watchers > 0

    def begin_watching(self) -> None:
        """Count one more who looks at pictures."""
        with self._lock:
            self.watchers += 1
        self.on_change()

    def end_watching(self) -> None:
        """Count one less."""
        with self._lock:
            self.watchers -= 1
        self.on_change()

    def change(self, changes: Mapping[str, Any]) -> None:
        """Change settings.

        Raises
        ------
        InputError
            As `settings.changed` and `Models.check`.
        """
        with self._lock:
            settings = changed(self.settings, changes)
            self.models.check(settings)
            self.settings = settings
        self.on_change()
        self._tell()

    def ask(self, request: Request) -> None:
        """Ask for something that the session does with its next bracket."""
        with self._lock:
            if len(self._requests) >= 8:
                raise InputError("too much is asked for at a time; wait for an answer")
            self._requests.append(request)
        self.on_change()

    def requests(self) -> list[Request]:
        """Return what was asked for since the last call."""
        with self._lock:
            asked, self._requests = self._requests, []
        return asked

    def answer(self, text: str, *, is_error: bool = False) -> None:
        """Tell those who watch what became of a request."""
        with self._lock:
            number = self.notice.number + 1 if self.notice else 1
            self.notice = Notice(number, text, is_error)
        self._tell()

    def last_seen(self) -> tuple[Seen | None, float]:
        """Return what was seen last, and its age in s by now."""
        last = self.newest
        if last is None:
            return None, 0.0
        return last.seen, last.age_s + time.monotonic() - last.published_s

    def publish(
        self, state: State, seen: Seen | None, age_s: float, account: Mapping[str, Any]
    ) -> None:
        """Put out the newest moment, in place of the last."""
        number = self.newest.number + 1 if self.newest else 1
        self.newest = LiveFrame(number, state, seen, age_s, time.monotonic(), account)
        self._tell()

    def _tell(self) -> None:
        for listener in self._listeners:
            listener()
