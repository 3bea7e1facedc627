"""Error against time of every estimator: what `fishlight chart estimators` draws.

Each estimator draws each case with a few samples per pixel, then with four times as many, and so
on; the reference (render/reference) stands beside them. What a picture errs by is that of a single
pass, bias and noise together.

Input  : cases.    Output : measurements, their means over the maps, a CSV of all.
A time is the CPU time, of all cores together, of a pass, or of the faster of two short ones,
without what is prepared before them: tables of the map, the tree of the scene. That is `setup_ms`.
Unlike time on the clock it is nearly the same while others use the machine.
Cost   : seven minutes for three scenes and three maps; what was measured before is not measured
         again as long as scene, map, machine and code are the same.
Fails  : what waits for another core costs nothing here: the reference's pools are drawn on one.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import msgspec
import numpy as np

from lighting.measures.chart import Point
from lighting.measures.known import remembered
from render.estimators.passes import passes_of
from render.estimators.registry import ESTIMATORS
from render.measures.chart import Case, measuring_digest
from render.measures.picture_errors import relative_rmse
from render.reference.accumulation import nothing_yet
from render.reference.sampled_light import Rays
from render.reference.tracing import render_reference
from render.scenes.scene import Camera

SAMPLES = (1, 4, 16, 64)
"""For each of four points of a pixel."""
REFERENCE = "reference"
ALL = "all"

_PASSES = 2
_LONG_S = 0.2
"""After a pass that takes more there is no second."""
_CORNER_PX = (16, 16)  # is drawn first: it compiles, and prepares what depends on the samples
_SLOW_S = 2.0
"""An estimator whose passes take more is not tried with more samples."""


class Convergence(msgspec.Struct, frozen=True):
    """What one estimator made of one scene under one map with some samples per pixel.

    `rmse` is relative to the truth, the root mean square over the passes; `rays` were traced in
    each.
    """

    scene: str
    map_name: str
    estimator: str
    samples: int
    ms: float
    setup_ms: float
    rays: int
    rmse: float


def systems() -> list[str]:
    """Return the names of what is compared: all estimators, and the reference."""
    return [*ESTIMATORS, REFERENCE]


def measure(
    cases: Iterable[Case],
    names: Sequence[str],
    samples: Sequence[int],
    known: dict[str, Convergence],
) -> Iterator[Convergence | None]:
    """Yield a measurement of each case, estimator and number of samples, ascending.

    None where an estimator would be too slow. `known` has earlier results, which are not measured
    again; new ones are added to it.
    """
    for case in cases:

        def measured(name: str, count: int, case: Case = case) -> Convergence:
            return _reference(case, count) if name == REFERENCE else _estimator(case, name, count)

        digest = f"{measuring_digest()} {case.digest}"
        for row in remembered(measured, digest, names, samples, known, _SLOW_S):
            # Known, it may have had other names.
            yield row and msgspec.structs.replace(
                row, scene=case.scene_name, map_name=case.map_name
            )


def points_of(rows: Iterable[Convergence]) -> list[Point]:
    """Return the points of the chart: geometric means over the maps, for each scene and all.

    A point's errors are by scene, and its times too, as `time_in(scene)`. A number of samples that
    an estimator did not reach in every case is left out: its mean would be over others.
    """
    kept = sorted(rows, key=lambda row: (systems().index(row.estimator), row.samples))
    groups = [
        (*name, list(group))
        for name, group in groupby(kept, lambda row: (row.estimator, row.samples))
    ]
    most = max((len(group) for *_, group in groups), default=0)
    points = []
    for name, count, group in groups:
        if len(group) < most:
            continue
        figures = {}
        for scene in (*dict.fromkeys(row.scene for row in group), ALL):
            of_scene = [row for row in group if scene in (ALL, row.scene)]
            figures[scene] = _geometric_mean([row.rmse for row in of_scene])
            figures[time_in(scene)] = _geometric_mean([row.ms for row in of_scene])
        points.append(Point(name, 4 * count, figures[time_in(ALL)], figures))
    return points


def time_in(scene: str) -> str:
    """Return what the milliseconds in a scene are called among a point's figures."""
    return f"{scene}, ms"


def _estimator(case: Case, name: str, samples: int) -> Convergence:
    start = time.process_time()
    with passes_of(name, case.scene, case.camera, case.environment, samples=samples) as add:
        setup_ms = 1e3 * (time.process_time() - start)
        add(0, 1, nothing_yet(_CORNER_PX).sums)

        def draw(number: int) -> tuple[np.ndarray, int]:
            sums = nothing_yet(case.camera.size_px).sums
            add(number, 1, sums)
            return sums.radiance, int(sums.rays.sum())

        return _measured(case, name, samples, setup_ms, draw)


def _reference(case: Case, samples: int) -> Convergence:
    """Return what the reference does: four passes, for it does nothing with fewer."""
    spent = Rays(2, samples, max(samples // 4, 1))

    def draw(number: int, camera: Camera = case.camera) -> tuple[np.ndarray, int]:
        picture = render_reference(
            case.scene, camera, case.environment, error=math.inf, seed=1 + number, spent=spent
        )
        return picture.radiance, picture.shadow_rays

    draw(0, replace(case.camera, size_px=_CORNER_PX))
    return _measured(case, REFERENCE, samples, 0.0, draw)


def _measured(
    case: Case,
    name: str,
    samples: int,
    setup_ms: float,
    draw: Callable[[int], tuple[np.ndarray, int]],
) -> Convergence:
    times_s, squares = [], []
    for number in range(_PASSES):
        start = time.process_time()
        picture, rays = draw(number)
        times_s.append(time.process_time() - start)
        squares.append(relative_rmse(picture, case.truth()) ** 2)
        if times_s[-1] > _LONG_S:
            break
    return Convergence(
        case.scene_name,
        case.map_name,
        name,
        samples,
        1e3 * min(times_s),
        setup_ms,
        rays,
        math.sqrt(np.mean(squares)),
    )


def _geometric_mean(values: Sequence[float]) -> float:
    return math.exp(np.mean(np.log(np.maximum(values, np.finfo(float).tiny))))
