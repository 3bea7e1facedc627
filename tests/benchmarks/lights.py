"""Light reduction against its peers: error of the diffuse irradiance, and milliseconds.

Peers, written here in plain numpy: uniform random points through the same inverse CDF, and the
median cut of Debevec, "A Median Cut Algorithm for Light Probe Sampling", SIGGRAPH posters, 2005
(regions halved by light, one light at the centroid of each), cut where the light is largest first
so that any count is served. The error is the relative root mean square over 192 normals against the
sum over all cells. Maps: an outdoor map made here, and captured ones where they are at hand.
"""

import heapq
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.environment import EnvironmentMap, luminance
from lighting.environment_files import read_environment
from lighting.latlong import cell_directions, direction_to_grid, solid_angles
from lighting.methods.inverse_cdf import inverse_cdf, sample_directions
from tests.environments import irradiance, normals, outdoors, true_irradiance

Array = NDArray[np.float64]
Lights = tuple[Array, Array]

COUNTS = (16, 64, 256, 1024)
_random = np.random.default_rng(0)
DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
CAPTURED = (
    "env-blender-world/city.exr",
    "env-blender-world/interior.exr",
    "env-polyhaven-drei/empty_warehouse_01_1k.hdr",
    "env-polyhaven-drei/venice_sunset_1k.hdr",
    "env-pmndrs/esplanade.exr",
    "env-pmndrs/hall.exr",
)


def ours(environment: EnvironmentMap, count: int) -> Lights:
    """Lights by the inverse CDF and the fixed points."""
    directions, light, _ = inverse_cdf(environment, count)
    return directions, light


def random_points(environment: EnvironmentMap, count: int) -> Lights:
    """Lights by the inverse CDF and random points, L/(n p) each."""
    directions, density = sample_directions(environment, _random.random((count, 2)))
    height = environment.height
    columns, rows = np.moveaxis(direction_to_grid(directions, height), -1, 0)
    rows = np.clip(np.round(rows).astype(int), 0, height - 1)
    cells = environment.radiance[rows, np.round(columns).astype(int) % (2 * height)]
    return directions, cells / (count * density)[:, None]


def median_cut(environment: EnvironmentMap, count: int) -> Lights:
    """Lights at the centroids of regions of nearly equal luminous power."""
    height = environment.height
    cells = environment.radiance * solid_angles(height)[:, None, None]
    weight = luminance(cells)
    polar = np.pi * (np.arange(height) + 0.5) / height
    total = np.pad(weight, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)

    def power(top: int, bottom: int, left: int, right: int) -> float:
        return total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]

    whole = (0, height, 0, 2 * height)
    heap = [(-power(*whole), whole)]
    final = []
    while heap and len(heap) + len(final) < count:
        _, (top, bottom, left, right) = heapq.heappop(heap)
        if bottom - top == 1 and right - left == 1:
            final.append((top, bottom, left, right))
            continue
        # Longer side on the sphere: a row's width shrinks with the sine of its polar angle.
        shrink = np.sin(polar[(top + bottom) // 2])
        if right - left > 1 and ((right - left) * shrink >= bottom - top or bottom - top == 1):
            sums = total[bottom, left : right + 1] - total[top, left : right + 1]
            cut = left + _half(sums)
            parts = ((top, bottom, left, cut), (top, bottom, cut, right))
        else:
            sums = total[top : bottom + 1, right] - total[top : bottom + 1, left]
            cut = top + _half(sums)
            parts = ((top, cut, left, right), (cut, bottom, left, right))
        for part in parts:
            heapq.heappush(heap, (-power(*part), part))

    all_directions = cell_directions(height)
    directions, light = [], []
    for top, bottom, left, right in [region for _, region in heap] + final:
        region = np.s_[top:bottom, left:right]
        centroid = np.einsum("rc,rcx->x", weight[region], all_directions[region])
        length = np.linalg.norm(centroid)
        if length > 0:
            directions.append(centroid / length)
            light.append(cells[region].sum(axis=(0, 1)))
    return np.array(directions), np.array(light)


def _half(sums: Array) -> int:
    """Return the interior index at which running sums (n + 1,) pass half their span."""
    middle = np.searchsorted(sums - sums[0], (sums[-1] - sums[0]) / 2)
    return int(np.clip(middle, 1, len(sums) - 2))


SYSTEMS: dict[str, Callable[[EnvironmentMap, int], Lights]] = {
    "fishlight": ours,
    "random points": random_points,
    "median cut (numpy)": median_cut,
}


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row per light count and system: ms on 1024×512, error over the maps."""
    timed = outdoors(512)
    maps = [outdoors(256)]
    maps += [read_environment(DATA / name)[0] for name in CAPTURED if (DATA / name).exists()]
    towards = normals()
    truths = [true_irradiance(towards, environment) for environment in maps]
    rows = []
    for count in COUNTS:
        seconds = _median_seconds(timed, count, repeats)
        for name, system in SYSTEMS.items():
            errors = [
                _relative_rms(irradiance(towards, *system(environment, count)), truth)
                for environment, truth in zip(maps, truths, strict=True)
            ]
            rows.append(
                {
                    "stage": "lights",
                    "case": f"{count} lights",
                    "system": name,
                    "ms": 1e3 * seconds[name],
                    "ratio": None if name == "fishlight" else seconds[name] / seconds["fishlight"],
                    "accuracy": {
                        "irradiance error %, median": 100 * float(np.median(errors)),
                        "irradiance error %, worst": 100 * float(np.max(errors)),
                        "maps": len(maps),
                    },
                }
            )
    return rows


def _median_seconds(environment: EnvironmentMap, count: int, repeats: int) -> dict[str, float]:
    """Time the systems in turn, so that they share whatever else the machine does."""
    seconds: dict[str, list[float]] = {name: [] for name in SYSTEMS}
    for repeat in range(repeats + 1):
        for name, system in SYSTEMS.items():
            start = time.perf_counter()
            system(environment, count)
            if repeat:  # the first compiles and warms the caches
                seconds[name].append(time.perf_counter() - start)
    return {name: float(np.median(values)) for name, values in seconds.items()}


def _relative_rms(measured: Array, true: Array) -> float:
    return float(np.sqrt(np.mean((measured - true) ** 2) / np.mean(true**2)))
