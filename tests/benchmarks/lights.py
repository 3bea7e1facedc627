"""Light reduction, every method and its peers: error of the diffuse irradiance, and milliseconds.

Peers, written here in plain numpy: uniform random points through the inverse CDF, and the median
cut of Debevec, "A Median Cut Algorithm for Light Probe Sampling", SIGGRAPH posters, 2005. The error
is the relative root mean square over 192 normals against the sum over all cells: of what a surface
receives under the open sky, and behind an occluder, a cone of 40° around a random direction above
the surface. An occluder hides a light wholly or not at all, or that share of the light's disc that
lies behind the cone's edge. Maps: an outdoor map made here, and captured ones where they are at
hand.
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
from lighting.methods.inverse_cdf import sample_directions
from lighting.reduce import METHODS
from tests.environments import normals, outdoors

Array = NDArray[np.float64]
Lights = tuple[Array, Array, Array]

OURS = "cells"
"""The method that peers' times are compared with."""
COUNTS = (16, 64, 256, 1024)
OCCLUDER_RADIUS_RAD = np.radians(40)
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


def random_points(environment: EnvironmentMap, count: int) -> Lights:
    """Lights by the inverse CDF and random points, L/(n p) each."""
    directions, density = sample_directions(environment, _random.random((count, 2)))
    height = environment.height
    columns, rows = np.moveaxis(direction_to_grid(directions, height), -1, 0)
    rows = np.clip(np.round(rows).astype(int), 0, height - 1)
    cells = environment.radiance[rows, np.round(columns).astype(int) % (2 * height)]
    share = np.minimum(1 / (4 * np.pi * count * density), 0.5)
    return directions, cells / (count * density)[:, None], 2 * np.arcsin(np.sqrt(share))


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
    directions, light, radius = [], [], []
    for top, bottom, left, right in [region for _, region in heap] + final:
        region = np.s_[top:bottom, left:right]
        centroid = np.einsum("rc,rcx->x", weight[region], all_directions[region])
        length = np.linalg.norm(centroid)
        if length > 0:
            directions.append(centroid / length)
            light.append(cells[region].sum(axis=(0, 1)))
            radius.append(np.arccos(np.clip(2 * length / weight[region].sum() - 1, 0, 1)))
    return np.array(directions), np.array(light), np.array(radius)


def _half(sums: Array) -> int:
    """Return the interior index at which running sums (n + 1,) pass half their span."""
    middle = np.searchsorted(sums - sums[0], (sums[-1] - sums[0]) / 2)
    return int(np.clip(middle, 1, len(sums) - 2))


SYSTEMS: dict[str, Callable[[EnvironmentMap, int], Lights]] = {
    **METHODS,
    "random points": random_points,
    "median cut (numpy)": median_cut,
}


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row per light count and system: ms on 1024×512, errors over the maps."""
    timed = outdoors(512)
    maps = [outdoors(256)]
    maps += [read_environment(DATA / name)[0] for name in CAPTURED if (DATA / name).exists()]
    truths = [received_from_cells(environment) for environment in maps]
    rows = []
    for count in COUNTS:
        seconds = _median_seconds(timed, count, repeats)
        for name, system in SYSTEMS.items():
            all_errors = [
                errors(system(environment, count), truth)
                for environment, truth in zip(maps, truths, strict=True)
            ]
            median = 100 * np.median(all_errors, axis=0)
            rows.append(
                {
                    "stage": "lights",
                    "case": f"{count} lights",
                    "system": name,
                    "ms": 1e3 * seconds[name],
                    "ratio": None if name in METHODS else seconds[name] / seconds[OURS],
                    "accuracy": {
                        "irradiance error %, median": median[0],
                        "irradiance error %, worst": 100 * float(np.max(all_errors, axis=0)[0]),
                        "occluded %, as points": median[1],
                        "occluded %, with extent": median[2],
                        "maps": len(maps),
                    },
                }
            )
    return rows


def errors(lights: Lights, truth: tuple[Array, Array]) -> tuple[float, float, float]:
    """Return relative errors: in the open, and occluded, of lights as points and as discs."""
    directions, light, angular_radius_rad = lights
    cosine = np.clip(normals() @ directions.T, 0, None)
    from_edge = np.arccos(np.clip(occluders() @ directions.T, -1, 1)) - OCCLUDER_RADIUS_RAD
    seen = disc_share(from_edge, angular_radius_rad)
    return (
        _relative_rms(cosine @ light, truth[0]),
        _relative_rms((cosine * (from_edge > 0)) @ light, truth[1]),
        _relative_rms((cosine * seen) @ light, truth[1]),
    )


def received_from_cells(environment: EnvironmentMap) -> tuple[Array, Array]:
    """Return irradiance (192, 3) from every cell of the map, in the open and behind occluders."""
    height = environment.height
    solid_angle = solid_angles(height)[:, None, None]
    light = environment.radiance * solid_angle
    directions = cell_directions(height)
    free = occluded = np.zeros((len(normals()), 3))
    for rows in np.array_split(np.arange(height), max(height // 32, 1)):
        towards = directions[rows].reshape(-1, 3).T
        cosine = np.clip(normals() @ towards, 0, None)
        free = free + cosine @ light[rows].reshape(-1, 3)
        cosine[occluders() @ towards > np.cos(OCCLUDER_RADIUS_RAD)] = 0
        occluded = occluded + cosine @ light[rows].reshape(-1, 3)
    return free, occluded


def occluders() -> Array:
    """Return the axis of each normal's occluder, (192, 3): uniform above the surface."""
    axes = np.random.default_rng(0).standard_normal(normals().shape)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    below = (axes * normals()).sum(axis=1) < 0
    return np.where(below[:, None], -axes, axes)


def disc_share(from_edge_rad: Array, radius_rad: Array) -> Array:
    """Return the share of a disc beyond a straight edge that its centre is `from_edge_rad` past."""
    x = np.clip(from_edge_rad / np.maximum(radius_rad, 1e-9), -1, 1)
    return 0.5 + (x * np.sqrt(1 - x * x) + np.arcsin(x)) / np.pi


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
