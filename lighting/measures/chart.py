"""Error against time of every way to find lights: what `fishlight chart lights` draws.

Each system, ours or a peer, reduces each map to 4 … 1024 lights; what it costs is measured here and
now, how far off the lights are by error_measures.py.

Input  : maps.    Output : measurements, their medians over the maps, a CSV of all.
A time is that of a frame in a stream: what a system remembers of the frame before it has, so the
adaptive method does not choose its fill anew.
Cost   : on two cores about a minute for a map of 256 rows; what was measured before is not measured
         again as long as map, machine and fishlight's own code are the same.
Fails  : times of a busy machine are too long, each by another factor.
"""

import csv
import hashlib
import io
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from statistics import fmean, median
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.measures import known as known_results
from lighting.measures.error_measures import behind_occluders, errors, truth
from lighting.measures.peers import Peer, installed_peers
from lighting.reduce import ADAPTIVE, METHODS, reduce_next
from lighting.stream.temporal import steady

Array = NDArray[np.float64]
System = Callable[[EnvironmentMap, int, Any], tuple[LightSet, Any]]
"""From a map, a count and what the frame before left, if any, to lights and what to remember."""

FLICKER = "flicker"
"""The figure of flicker.py."""
STEADY = "adaptive, steady"
"""The temporal stage after the adaptive method. Of a map that stands still it makes what the method
does, so of its errors only flicker is measured."""
COUNTS = (4, 8, 16, 32, 64, 128, 256, 512, 1024)
_REPEATS = 7
_SLOW_S = 2.0
"""A reduction that takes longer is not repeated, and not tried with more lights."""


class Measurement(msgspec.Struct, frozen=True):
    """What one system made of one map with one number of lights.

    `lights` is how many came back, `errors` relative errors by figure: "open, points" is that of
    irradiance in the open from lights as points, "open, discs" with their extent; likewise "wall",
    "sphere" and "comb", and "occluded", the root mean square of these three.
    """

    map_name: str
    system: str
    count: int
    lights: int
    ms: float
    errors: dict[str, float]


@dataclass(frozen=True)
class Point:
    """Medians over the maps of one system with one number of lights."""

    system: str
    count: int
    ms: float
    errors: Mapping[str, float]


def systems() -> tuple[dict[str, System], list[str]]:
    """Return all methods and installed peers by name, and the names of peers not installed."""
    peers, missing = installed_peers()
    ours: dict[str, System] = {name: partial(_reduced, name) for name in METHODS}
    ours[STEADY] = _steadied
    return ours | {name: partial(_lights_of, peer) for name, peer in peers.items()}, missing


def measure(
    maps: Mapping[str, EnvironmentMap],
    compared: Mapping[str, System],
    counts: Sequence[int],
    known: dict[str, Measurement],
) -> Iterator[Measurement | None]:
    """Yield a measurement of each map, system and count; None where the system would be too slow.

    Parameters
    ----------
    maps : mapping of str to EnvironmentMap
        By name.
    compared : mapping of str to System
        By name, as from `systems`.
    counts : sequence of int
        Ascending.
    known : dict of str to Measurement
        Earlier results, which are not measured again; new ones are added to it.
    """
    for map_name, environment in maps.items():
        digest = hashlib.sha256(environment.radiance.tobytes()).hexdigest()[:16]
        measured = _on_map(map_name, environment, compared)
        for found in known_results.remembered(
            measured, f"{lighting_digest()} {digest}", compared, counts, known, _SLOW_S
        ):
            yield found and msgspec.structs.replace(found, map_name=map_name)


def points_of(
    on_maps: Iterable[Measurement], on_sequences: Iterable[Measurement] = ()
) -> list[Point]:
    """Return the points of the chart, system by system, counts ascending.

    Times and errors are medians over maps, flicker is the mean over sequences: what makes lights
    flicker differs, and a median would hide what most sequences spare a system. A count that a
    system did not reach on every map is left out, and so is flicker not known of every sequence:
    other means would be over other things than the rest of the line.
    """
    flicker = _complete_groups(on_sequences)
    points = []
    for (system, count), group in _complete_groups(on_maps).items():
        errors_of_point = {
            figure: median(measurement.errors[figure] for measurement in group)
            for figure in group[0].errors
        }
        if (system, count) in flicker:
            errors_of_point[FLICKER] = fmean(
                measurement.errors[FLICKER] for measurement in flicker[system, count]
            )
        ms = median(measurement.ms for measurement in group)
        points.append(Point(system, count, ms, errors_of_point))
    return points


def pareto_front(
    points: Iterable[Point], figure: str, cost: Callable[[Point], float] = lambda point: point.ms
) -> list[Point]:
    """Return the points than which none is both cheaper and truer, from cheap to true."""
    front: list[Point] = []
    with_figure = [point for point in points if figure in point.errors]
    for point in sorted(with_figure, key=lambda point: (cost(point), point.errors[figure])):
        if not front or point.errors[figure] < front[-1].errors[figure]:
            front.append(point)
    return front


def as_csv(measurements: Sequence[Measurement]) -> str:
    """Return a line for each measurement, errors as shares of the true irradiance.

    A figure that was not measured is empty.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    figures = list(dict.fromkeys(figure for row in measurements for figure in row.errors))
    writer.writerow(["map", "system", "count", "lights", "ms", *figures])
    for row in measurements:
        numbers = (
            f"{row.errors[figure]:.6g}" if figure in row.errors else "" for figure in figures
        )
        name = (row.map_name, row.system, row.count, row.lights)
        writer.writerow([*name, f"{row.ms:.4g}", *numbers])
    return text.getvalue()


def read_known(path: Path) -> dict[str, Measurement]:
    """Return earlier results of this code from a file of `known.write_known`."""
    return known_results.read_known(path, Measurement, lighting_digest())


def _complete_groups(
    measurements: Iterable[Measurement],
) -> dict[tuple[str, int], list[Measurement]]:
    """Return measurements by system and count, of those that are on all maps."""
    groups: dict[tuple[str, int], list[Measurement]] = {}
    for measurement in measurements:
        groups.setdefault((measurement.system, measurement.count), []).append(measurement)
    most = max((len(group) for group in groups.values()), default=0)
    return {key: group for key, group in groups.items() if len(group) == most}


def _on_map(
    map_name: str, environment: EnvironmentMap, compared: Mapping[str, System]
) -> Callable[[str, int], Measurement]:
    """Return what measures a system with a count on one map."""
    true = cache(partial(truth, environment))  # found when first needed: it takes seconds

    def measured(name: str, count: int) -> Measurement:
        lights, ms = _timed(compared[name], environment, count)
        figures = {} if name == STEADY else _figures(lights, true())
        return Measurement(map_name, name, count, len(lights), ms, figures)

    return measured


def _figures(lights: LightSet, true: Mapping[str, Array]) -> dict[str, float]:
    figures: dict[str, float] = {}
    for shape, as_points in (("points", True), ("discs", False)):
        by_kind = errors(lights, true, as_points=as_points)
        figures |= {f"{kind}, {shape}": error for kind, error in by_kind.items()}
        figures[f"occluded, {shape}"] = behind_occluders(by_kind)
    return figures


def _timed(system: System, environment: EnvironmentMap, count: int) -> tuple[LightSet, float]:
    """Return the lights, and the least time in ms of a frame after the first, which fills caches.

    The least, because whatever else the machine does only ever adds.
    """
    times_s = []
    memory = None
    for _ in range(1 + _REPEATS):
        start = time.perf_counter()
        lights, memory = system(environment, count, memory)
        times_s.append(time.perf_counter() - start)
        if len(times_s) > 1 and times_s[-1] > _SLOW_S:
            break
    return lights, 1e3 * min(times_s[1:])


def _reduced(
    method: str, environment: EnvironmentMap, count: int, memory: Any
) -> tuple[LightSet, Any]:
    return reduce_next(environment, count, method, memory)


def _steadied(environment: EnvironmentMap, count: int, memory: Any) -> tuple[LightSet, Any]:
    of_method, of_stage = memory or (None, None)
    lights, of_method = reduce_next(environment, count, ADAPTIVE, of_method)
    lights, of_stage = steady(lights, of_stage)
    return lights, (of_method, of_stage)


def _lights_of(
    peer: Peer, environment: EnvironmentMap, count: int, _memory: Any
) -> tuple[LightSet, None]:
    return LightSet(*peer(environment, count)), None


def lighting_digest() -> str:
    """Return what results of this code begin with."""
    return known_results.code_digest(Path(__file__).parents[1])
