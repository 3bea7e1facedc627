"""Error against time of every way to find lights: what `fishlight chart lights` draws.

Each system, ours or a peer, reduces each map to 4 … 1024 lights; what it costs is measured here and
now, how far off the lights are by error_measures.py.

Input  : maps.    Output : measurements, their medians over the maps, a CSV of all.
Cost   : on two cores about a minute for a map of 256 rows; what was measured before is not measured
         again as long as map, machine and fishlight's own code are the same.
Fails  : times of a busy machine are too long, each by another factor.
"""

import csv
import hashlib
import io
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from statistics import median

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.output import write_json
from lighting.environment import EnvironmentMap
from lighting.error_measures import behind_occluders, errors, truth
from lighting.light_set import LightSet
from lighting.peers import Peer, installed_peers
from lighting.reduce import METHODS, reduce_to_lights

Array = NDArray[np.float64]
System = Callable[[EnvironmentMap, int], LightSet]

COUNTS = (4, 8, 16, 32, 64, 128, 256, 512, 1024)
_REPEATS = 5
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


class _File(msgspec.Struct):
    measurements: dict[str, Measurement]


def systems() -> tuple[dict[str, System], list[str]]:
    """Return every method and installed peer by name, and the names of peers not installed."""
    peers, missing = installed_peers()
    ours: dict[str, System] = {name: partial(_reduced, method=name) for name in METHODS}
    return ours | {name: partial(_lights_of, peer) for name, peer in peers.items()}, missing


def measure(
    maps: Mapping[str, EnvironmentMap],
    compared: Mapping[str, System],
    counts: Sequence[int] = COUNTS,
    known: dict[str, Measurement] | None = None,
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
    known : dict of str to Measurement, optional
        Earlier results, which are not measured again; new ones are added to it.
    """
    known = {} if known is None else known
    for map_name, environment in maps.items():
        digest = _digest(environment)
        # Found when first needed: it takes seconds.
        true = cache(partial(truth, environment))
        for name, system in compared.items():
            is_slow = False
            for count in counts:
                if is_slow:
                    yield None
                    continue
                key = f"{_code_digest()} {digest} {name} {count}"
                if key not in known:
                    known[key] = _measured(map_name, environment, name, system, count, true())
                is_slow = known[key].ms > 1e3 * _SLOW_S
                yield msgspec.structs.replace(known[key], map_name=map_name)


def medians(measurements: Iterable[Measurement]) -> list[Point]:
    """Return the points of the chart, system by system, counts ascending.

    A count that a system did not reach on every map is left out: its median would be over other
    maps than the rest of its line.
    """
    groups: dict[tuple[str, int], list[Measurement]] = {}
    for measurement in measurements:
        groups.setdefault((measurement.system, measurement.count), []).append(measurement)
    maps = max((len(group) for group in groups.values()), default=0)
    return [
        Point(
            system,
            count,
            median(measurement.ms for measurement in group),
            {
                figure: median(measurement.errors[figure] for measurement in group)
                for figure in group[0].errors
            },
        )
        for (system, count), group in groups.items()
        if len(group) == maps
    ]


def pareto_front(points: Iterable[Point], figure: str) -> list[Point]:
    """Return the points than which none is both faster and truer, from fast to true."""
    front: list[Point] = []
    for point in sorted(points, key=lambda point: (point.ms, point.errors[figure])):
        if not front or point.errors[figure] < front[-1].errors[figure]:
            front.append(point)
    return front


def as_csv(measurements: Sequence[Measurement]) -> str:
    """Return a line for each measurement, errors as shares of the true irradiance."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    figures = list(measurements[0].errors)
    writer.writerow(["map", "system", "count", "lights", "ms", *figures])
    for row in measurements:
        numbers = (f"{row.errors[figure]:.6g}" for figure in figures)
        name = (row.map_name, row.system, row.count, row.lights)
        writer.writerow([*name, f"{row.ms:.4g}", *numbers])
    return text.getvalue()


def read_known(path: Path) -> dict[str, Measurement]:
    """Return earlier results from a file of `write_known`, none if it is not there."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=_File).measurements
    except FileNotFoundError:
        return {}
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"{path}: not a file of earlier results ({error}); remove it") from error


def write_known(path: Path, known: dict[str, Measurement]) -> None:
    """Write results for later runs, whole or not at all."""
    write_json(path, _File(known))


def _measured(
    map_name: str,
    environment: EnvironmentMap,
    name: str,
    system: System,
    count: int,
    true: Mapping[str, Array],
) -> Measurement:
    lights, ms = _timed(partial(system, environment, count))
    figures: dict[str, float] = {}
    for shape, as_points in (("points", True), ("discs", False)):
        by_kind = errors(lights, true, as_points=as_points)
        figures |= {f"{kind}, {shape}": error for kind, error in by_kind.items()}
        figures[f"occluded, {shape}"] = behind_occluders(by_kind)
    return Measurement(map_name, name, count, len(lights), ms, figures)


def _timed(call: Callable[[], LightSet]) -> tuple[LightSet, float]:
    """Return the result, and the median time in ms after a first call that fills caches."""
    times_s = []
    for _ in range(1 + _REPEATS):
        start = time.perf_counter()
        lights = call()
        times_s.append(time.perf_counter() - start)
        if len(times_s) > 1 and times_s[-1] > _SLOW_S:
            break
    return lights, 1e3 * median(times_s[1:])


def _reduced(environment: EnvironmentMap, count: int, *, method: str) -> LightSet:
    return reduce_to_lights(environment, count, method)


def _lights_of(peer: Peer, environment: EnvironmentMap, count: int) -> LightSet:
    return LightSet(*peer(environment, count))


def _digest(environment: EnvironmentMap) -> str:
    return hashlib.sha256(environment.radiance.tobytes()).hexdigest()[:16]


@cache
def _code_digest() -> str:
    """Return what tells versions of this package, and machines, apart."""
    digest = hashlib.sha256(platform.node().encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
