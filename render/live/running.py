"""A live session from its source's opening to its end, and what is told when something is missing.

Where somebody may be watching, what is missing is a state that passes: the source and its
calibration are looked for again every two seconds. Without a watcher it is an error at once.
"""

from dataclasses import dataclass
from pathlib import Path
from threading import Event

from calibration.files import read_calibration
from capture.errors import CameraLost, CameraStalled, FishlightError, InputError
from capture.v4l2.camera import CameraRequest
from render.live.desk import Desk, State, StateName
from render.live.picture import LivePicture
from render.live.results import Results
from render.live.saving import Say
from render.live.session import LiveSession
from render.live.sources import PacedRecording, Source, open_source
from render.session import Counters

RETRY_S = 2.0


@dataclass(frozen=True)
class LiveRequest:
    """What a live session was asked to be.

    Attributes
    ----------
    camera : CameraRequest
        Whose `device` may be a recording's folder.
    calibration_path : Path or None
        A recording's own if not given.
    mains_hz : float or None
        As in capture.exposure_choice.ExposureChooser.
    once : bool
        Whether a recording ends at its end.
    map_height : int
    output : Path
        Folder for what is saved.
    """

    camera: CameraRequest
    calibration_path: Path | None
    mains_hz: float | None
    once: bool
    map_height: int
    output: Path


class Stop:
    """Ends a session, and whatever it waits for; from any thread."""

    def __init__(self) -> None:
        self._event = Event()
        self._source: Source | None = None

    @property
    def is_set(self) -> bool:
        """Whether the session is to end."""
        return self._event.is_set()

    def set(self) -> None:
        """End the session."""
        self._event.set()
        if self._source is not None:
            self._source.stop()

    def hold(self, source: Source) -> None:
        """Have `set` stop this source."""
        self._source = source
        if self.is_set:
            source.stop()

    def wait(self, duration_s: float) -> bool:
        """Wait for so long, or until the end; whether that has come."""
        return self._event.wait(duration_s)


class Missing(FishlightError):
    """What a session lacks, the state that says so, and what was counted until then."""

    def __init__(
        self, name: StateName, error: FishlightError, counters: Counters | None = None
    ) -> None:
        super().__init__(str(error))
        self.name = name
        self.counters = counters or Counters()


def run_live(
    request: LiveRequest,
    desk: Desk,
    picture: LivePicture | None,
    stop: Stop,
    *,
    is_patient: bool,
    say: Say = lambda _text: None,
) -> Counters:
    """Run sessions until `stop` is set or the source ends by itself; return the counters.

    Parameters
    ----------
    request : LiveRequest
    desk : Desk
    picture : LivePicture or None
        None draws nothing.
    stop : Stop
    is_patient : bool
        Whether to wait for what is missing.
    say : callable
        Told of what is missing, once, and of what was saved.

    Raises
    ------
    FishlightError
        If something is missing and `is_patient` is not set.
    """
    desk.publish(State("starting", f"Opening {request.camera.device}."), *desk.last_seen(), {})
    told, total = "", Counters()
    while True:
        try:
            return total + _run_once(request, desk, picture, stop, say)
        except Missing as missing:
            if not is_patient:
                raise
            total += missing.counters
            desk.publish(State(missing.name, str(missing)), *desk.last_seen(), {})
            if str(missing) != told:
                told = str(missing)
                say(f"{told}; looking for it until it is there")
            if stop.wait(RETRY_S):
                return total


def _run_once(
    request: LiveRequest,
    desk: Desk,
    picture: LivePicture | None,
    stop: Stop,
    say: Say,
) -> Counters:
    exposures_s = desk.settings.exposures_s
    try:
        opened = open_source(
            request.camera, exposures_s=exposures_s, mains_hz=request.mains_hz, once=request.once
        )
    except (InputError, CameraLost, CameraStalled) as error:
        raise Missing("no-camera", error) from error
    with opened as source:
        stop.hold(source)
        if isinstance(source, PacedRecording):
            desk.on_change = source.repeat  # a camera's next bracket comes soon enough
        try:
            path = _calibration_path(request, source)
            calibration = read_calibration(path)
            calibration.check_size(source.size_px, source.name)
        except InputError as error:
            raise Missing("calibration", error) from error
        with Results(desk, request.output, source.name, source.sensor, path, say) as results:
            session = LiveSession(
                desk, source, calibration, request.map_height, picture, results.look_at
            )
            try:
                return session.run()
            except (CameraLost, CameraStalled) as error:
                raise Missing("no-camera", error, session.counters) from error


def _calibration_path(request: LiveRequest, source: Source) -> Path:
    path = request.calibration_path
    if path is None and isinstance(source, PacedRecording):
        path = source.calibration_path
    if path is None:
        raise InputError(
            f"{source.name} comes without a calibration; give one with --calibration cal.json"
        )
    return path
