"""The folder that a replay leaves: maps, lights, pictures, a video of them, and an account.

Fails  : nothing is written, and no earlier replay removed, before the first bracket has become a
         picture.
"""

import shutil
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.output import PARTIAL_PREFIX, write_json
from capture.pictures import write_png
from lighting.light_files import write_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from render.output.background_writer import BackgroundWriter
from render.output.preview import preview
from render.output.video import VideoWriter
from render.output.view import auto_exposure_ev, to_display

SESSION_FILE = "session.json"
RESULT_NAMES = ("maps", "lights", "pictures", "video.mp4", SESSION_FILE)


def check_output(output: Path, *, force: bool) -> None:
    """Raise InputError unless the results of a replay may go to `output`.

    They may if it does not exist or is an empty folder, and with `force` if an earlier replay made
    it: that is told by its session.json.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; the results need a folder")
    if output.is_dir() and any(output.iterdir()):
        if not force:
            raise InputError(f"{output} is not empty; give --force to replace an earlier replay")
        if not (output / SESSION_FILE).is_file():
            raise InputError(
                f"{output} holds no {SESSION_FILE}, so no replay made it, and it is left alone"
            )


class ReplayFolder:
    """Writes what becomes of each bracket; a context manager, at the end of which all of it is.

    A thread of its own encodes and writes; an error of it is raised by a later call or at the end.

    Parameters
    ----------
    output : Path
        The folder; made, and emptied of an earlier replay, when the first bracket is written.
    size_px : (int, int)
        (width, height) of the pictures.
    rate_hz : float
        Of the video.
    """

    def __init__(self, output: Path, size_px: tuple[int, int], rate_hz: float) -> None:
        self._output = output
        self._size_px = size_px
        self._rate_hz = rate_hz
        self._open = ExitStack()
        self._writer = BackgroundWriter()
        self._video: VideoWriter | None = None
        self._exposure_ev = 0.0
        self._last_picture: NDArray[np.uint8] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        closing = ExitStack()
        closing.push(self._open)
        closing.push(self._writer)  # ends first: the video that it writes to must hear its errors
        closing.__exit__(kind, error, traceback)

    def write(
        self,
        index: int,
        environment: EnvironmentMap,
        lights: LightSet,
        radiance: NDArray[np.float32],
    ) -> None:
        """Write the map, the lights and the picture (H, W, 4) of bracket `index`.

        They are written later, and must not change any more.
        """
        self._writer.call(lambda: self._write(index, environment, lights, radiance))

    def hold(self) -> None:
        """Show the last picture for one more bracket, if there is one."""
        self._writer.call(self._hold)

    def _write(
        self,
        index: int,
        environment: EnvironmentMap,
        lights: LightSet,
        radiance: NDArray[np.float32],
    ) -> None:
        if self._video is None:
            _prepare(self._output)
            # One for all pictures, so that a change of brightness can be seen.
            self._exposure_ev = auto_exposure_ev(radiance)
            video = VideoWriter(self._output / "video.mp4", self._size_px, self._rate_hz)
            self._video = self._open.enter_context(video)
        picture = to_display(radiance, self._exposure_ev)
        self._video.write(picture)
        self._last_picture = picture
        name = f"{index:06d}"
        shown_map = preview(environment, lights, self._exposure_ev)
        write_environment(self._output / "maps" / f"{name}.exr", environment)
        write_png(self._output / "maps" / f"{name}.png", shown_map)
        write_lights(self._output / "lights" / f"{name}.json", lights, force=True)
        write_png(self._output / "pictures" / f"{name}.png", picture)

    def _hold(self) -> None:
        if self._video is not None and self._last_picture is not None:
            self._video.write(self._last_picture)


def write_session(output: Path, status: str, account: Mapping[str, Any]) -> None:
    """Write session.json, by which a later replay knows the folder."""
    content = {"schema": "fishlight-session/1", "status": status, **account}
    write_json(output / SESSION_FILE, content)


def _prepare(output: Path) -> None:
    """Make the result folder, emptied of an earlier replay's results and of nothing else."""
    left_by_a_kill = output.glob(f"{PARTIAL_PREFIX}*")
    for path in (*(output / name for name in RESULT_NAMES), *left_by_a_kill):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    for name in ("maps", "lights", "pictures"):
        (output / name).mkdir(parents=True, exist_ok=True)
    write_session(output, "running", {})
