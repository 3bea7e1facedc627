"""Error against time of every way to a picture: what `fishlight chart render` draws.

Each way draws each scene under the lights that each map is reduced to, 4 … 1024 of them, and is
compared with the reference picture under the whole map: so what lights lose counts too.

Input  : scenes, maps, ways.    Output : measurements, their medians, a CSV of all.
A time is that of a frame after the first, in which everything is new that may be in that way, and
the least of several.
Cost   : 25 minutes or less for three scenes and five maps on two idle cores; what was measured
         before is not measured again as long as scene, map, machine and code are the same.
Fails  : times of a busy machine are too long, each by another factor.
"""

import csv
import io
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from statistics import median

import msgspec
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.measures.chart import Point
from lighting.measures.known import code_digest, remembered
from lighting.reduce import reduce_to_lights
from render.measures.chart_scenes import map_digest, view_digest
from render.measures.picture_errors import Truth, mean_flip, relative_rmse
from render.measures.ways import MAIN_WAYS, ROAMING, TRANSPORT, Draw, Way
from render.scenes.scene import Camera, Scene

COUNTS = (4, 16, 64, 256, 1024)
COUNTS_OF_SETTINGS = (16, 64, 256)
"""Of ways that differ from another in a setting only."""
RMSE, FLIP, MS = "relative RMSE", "FLIP", "ms"
WORST = "relative RMSE, worst"
SETTINGS_RMSE, SETTINGS_FLIP = "relative RMSE, settings", "FLIP, settings"

_FRAMES, _LEAST_FRAMES = 4, 2
_ENOUGH_S = 1.0
"""Of frames; the least of them is taken."""
_SLOW_S = 2.0
"""A way that takes longer for a frame is not tried with more lights."""

_ROOT = Path(__file__).parents[1]


class Measurement(msgspec.Struct, frozen=True):
    """What one way made of one scene under one map with one number of lights.

    `count` lights were asked for, `lights` came; `setup_ms` is what the way did before the first
    frame, once for scene and camera. Of `flip`, `least_flip` is noise of the truth.
    """

    scene: str
    map_name: str
    way: str
    count: int
    lights: int
    ms: float
    setup_ms: float
    rmse: float
    flip: float
    least_flip: float


@dataclass(frozen=True)
class Case:
    """A scene under a map, and what tells it apart from any other.

    Attributes
    ----------
    truth : callable
        Returns the truth, when it is first needed: it takes seconds.
    """

    scene_name: str
    map_name: str
    scene: Scene
    camera: Camera
    environment: EnvironmentMap
    truth: Callable[[], Truth]

    @property
    def digest(self) -> str:
        """Tells the case apart by what is in it, whatever it is called."""
        return f"{view_digest(self.scene, self.camera)} {map_digest(self.environment)}"


def measure(
    cases: Iterable[Case],
    ways: Mapping[str, Way],
    counts: Mapping[str, Sequence[int]],
    known: dict[str, Measurement],
) -> Iterator[Measurement | None]:
    """Yield a measurement of each case, way and count; None where the way would be too slow.

    Parameters
    ----------
    cases : iterable of Case
    ways : mapping of str to Way
    counts : mapping of str to sequence of int
        Of lights for each way, ascending.
    known : dict of str to Measurement
        Earlier results, which are not measured again; new ones are added to it.
    """
    for case in cases:
        lights = cache(partial(reduce_to_lights, case.environment))
        for name, way in ways.items():
            yield from _of_way(case, name, way, lights, counts[name], known)


def open_way(stack: ExitStack, way: Way, scene: Scene, camera: Camera) -> tuple[Draw, float]:
    """Return what draws, until `stack` is left, and the milliseconds that this took."""
    start = time.perf_counter()
    draw = stack.enter_context(way(scene, camera))
    return draw, 1e3 * (time.perf_counter() - start)


def timed_frames(
    draw: Draw, lights: LightSet, environment: EnvironmentMap
) -> tuple[NDArray[np.float32], float]:
    """Return the picture of frame 0, and the least milliseconds of frames that follow another."""
    draw(lights, environment, 1)  # all is new, lights that stand would be judged, moving ones timed
    times_s: list[float] = []
    while len(times_s) < _LEAST_FRAMES or (len(times_s) < _FRAMES and sum(times_s) < _ENOUGH_S):
        start = time.perf_counter()
        drawn = draw(lights, environment, len(times_s))
        times_s.append(time.perf_counter() - start)
        if len(times_s) == 1:
            picture = drawn
    return picture, 1e3 * min(times_s)


def points_of(measurements: Iterable[Measurement]) -> list[Point]:
    """Return the points of the chart: medians over the cases, and the largest error.

    A count that a way did not reach in every case is left out: its median would be over others.
    Settings are compared among themselves and with the ways that they are of.
    """

    def key(row: Measurement) -> tuple[str, int]:
        return row.way, row.count

    rows = list(measurements)
    order = {name: number for number, name in enumerate(dict.fromkeys(row.way for row in rows))}
    rows.sort(key=lambda row: (order[row.way], row.count))
    groups = [(*name, list(group)) for name, group in groupby(rows, key)]
    most = max((len(group) for *_, group in groups), default=0)
    points = []
    for way, count, group in groups:
        if len(group) < most:
            continue
        ms, rmse, flip = (
            median(getattr(row, name) for row in group) for name in ("ms", "rmse", "flip")
        )
        figures = {}
        if way in MAIN_WAYS:
            figures = {RMSE: rmse, FLIP: flip, WORST: max(row.rmse for row in group), MS: ms}
        if way not in (TRANSPORT, ROAMING) and count in COUNTS_OF_SETTINGS:
            figures |= {SETTINGS_RMSE: rmse, SETTINGS_FLIP: flip}
        points.append(Point(way, count, ms, figures))
    return points


def as_csv(rows: Sequence[msgspec.Struct]) -> str:
    """Return a line for each measurement, all of one kind; errors are shares."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0].__struct_fields__)
    for row in rows:
        values = msgspec.structs.astuple(row)
        writer.writerow(f"{value:.5g}" if isinstance(value, float) else value for value in values)
    return text.getvalue()


def measuring_digest() -> str:
    """Return what tells versions apart of all code that a frame's time and error depend on."""
    return code_digest(_ROOT, _ROOT.parent / "lighting")


def _of_way(
    case: Case,
    name: str,
    way: Way,
    lights: Callable[[int], LightSet],
    counts: Sequence[int],
    known: dict[str, Measurement],
) -> Iterator[Measurement | None]:
    with ExitStack() as stack:
        opened = cache(partial(open_way, stack, way, case.scene, case.camera))

        def measured(name: str, count: int) -> Measurement:
            return _measured(case, name, lights(count), count, *opened())

        digest = f"{measuring_digest()} {case.digest}"
        for row in remembered(measured, digest, [name], counts, known, _SLOW_S):
            # Known, it may have had other names.
            yield row and msgspec.structs.replace(
                row, scene=case.scene_name, map_name=case.map_name
            )


def _measured(
    case: Case, name: str, lights: LightSet, count: int, draw: Draw, setup_ms: float
) -> Measurement:
    picture, ms = timed_frames(draw, lights, case.environment)
    truth = case.truth()
    errors = relative_rmse(picture, truth), mean_flip(picture, truth), truth.least_flip
    return Measurement(
        case.scene_name, case.map_name, name, count, len(lights), ms, setup_ms, *errors
    )
