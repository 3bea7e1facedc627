"""Ways to find lights that are not fishlight's, for comparison.

Each is a function of a map and a count, as fishlight's methods are (reduce.py). Two are programs of
others, called as their documents say and there only if they are installed; the rest is plain numpy.

Input  : EnvironmentMap with light.    Output : directions, irradiance and angular radii.
"""

import heapq
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sampling.sampled_lights import cone_radius
from lighting.sphere.latlong import cell_directions, grid_to_direction, solid_angles

Array = NDArray[np.float64]
Lights = tuple[Array, Array, Array]
Peer = Callable[[EnvironmentMap, int], Lights]
Region = tuple[int, int, int, int]


def random_points(environment: EnvironmentMap, count: int) -> Lights:
    """Return lights at random points of the map, drawn by rows and then columns."""
    return _points_of_cdf(environment, np.random.default_rng(count).random((count, 2)))


def hammersley_points(environment: EnvironmentMap, count: int) -> Lights:
    """Return lights at the points (i/n, radical inverse of i in base 2), moved by half a step."""
    index = np.arange(count)
    bits = np.arange(max(count - 1, 1).bit_length())
    inverse = ((index[:, None] >> bits & 1) / 2.0 ** (bits + 1)).sum(axis=1)
    return _points_of_cdf(environment, np.stack([index / count, inverse], axis=-1) + 0.5 / count)


def median_cut(environment: EnvironmentMap, count: int) -> Lights:
    """Return lights at the centroids of regions of nearly equal luminous power.

    P. Debevec, "A Median Cut Algorithm for Light Probe Sampling", SIGGRAPH posters, 2005; the
    region of most power is cut next, so that any count can be had.
    """
    height = environment.height
    light = environment.radiance * solid_angles(height)[:, None, None]
    weight = luminance(light)
    total = np.pad(weight, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)

    def queued(region: Region) -> tuple[float, Region]:
        top, bottom, left, right = region
        power = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]
        return -float(power), region

    queue = [queued((0, height, 0, 2 * height))]
    final: list[Region] = []
    while queue and len(queue) + len(final) < count:
        _, region = heapq.heappop(queue)
        parts = _median_parts(total, region)
        if parts:
            for part in parts:
                heapq.heappush(queue, queued(part))
        else:
            final.append(region)
    return _centroids(light, weight, [region for _, region in queue] + final)


def mitsuba_points(environment: EnvironmentMap, count: int) -> Lights:
    """Return Mitsuba 3's samples of its `envmap` emitter, one by one, from its scalar variant."""
    mitsuba = _mitsuba()
    bitmap = mitsuba.Bitmap(np.array(environment.radiance))
    scene = mitsuba.load_dict({"type": "scene", "map": {"type": "envmap", "bitmap": bitmap}})
    emitter = scene.emitters()[0]
    here = mitsuba.SurfaceInteraction3f()
    directions, weights, density = [], [], []
    for point in np.random.default_rng(count).random((count, 2)):
        sample, weight = emitter.sample_direction(here, point)
        directions.append(np.array(sample.d, np.float64).ravel())
        weights.append(np.array(weight, np.float64).ravel())
        density.append(float(sample.pdf))
    solid_angle = 1 / (count * np.array(density))
    return np.array(directions), np.array(weights) / count, cone_radius(solid_angle)


def colour_hdri_regions(environment: EnvironmentMap, count: int) -> Lights:
    """Return the lights of colour-hdri's variance minimisation.

    It sums over pixels, so it gets radiance × solid angle. Asked for n it makes 2^√n, so it is
    asked for what gives the count, or the power of two below.
    """
    sample = import_module("colour_hdri").light_probe_sampling_variance_minimization_Viriyothai2009
    height = environment.height
    light = environment.radiance * solid_angles(height)[:, None, None]
    with np.errstate(all="ignore"):  # it divides by the power of dark regions
        found = sample(light, max(count.bit_length() - 1, 1) ** 2)
    grid = np.array([specification.uv for specification in found]) * (2 * height, height)
    irradiance = np.array([specification.colour for specification in found], np.float64)
    return grid_to_direction(grid, height), irradiance, np.zeros(len(found))


def installed_peers() -> tuple[Mapping[str, Peer], list[str]]:
    """Return the peers that can run here by name, and the names of those not installed."""
    plain: dict[str, Peer] = {
        "random points": random_points,
        "Hammersley points": hammersley_points,
        "median cut (numpy)": median_cut,
    }
    programs: dict[str, tuple[str, Peer]] = {
        "Mitsuba 3 (scalar)": ("mitsuba", mitsuba_points),
        "colour-hdri": ("colour_hdri", colour_hdri_regions),
    }
    there = {name: peer for name, (module, peer) in programs.items() if find_spec(module)}
    return plain | there, [name for name in programs if name not in there]


def _points_of_cdf(environment: EnvironmentMap, points: Array) -> Lights:
    """Return lights of L/(n p) at points (n, 2) in [0, 1)², p the luminance over its integral."""
    height, width = environment.radiance.shape[:2]
    solid_angle = solid_angles(height)
    light = luminance(environment.radiance)
    cumulative = np.concatenate([[0.0], np.cumsum(light * solid_angle[:, None])])
    row_starts = cumulative[::width]
    rows = np.searchsorted(row_starts, points[:, 0] * cumulative[-1], side="right") - 1
    within = row_starts[rows] + points[:, 1] * (row_starts[rows + 1] - row_starts[rows])
    cells = np.searchsorted(cumulative, within, side="right") - 1
    columns = cells % width
    # The rest of each coordinate says where in its cell the point lies.
    edges = cumulative[cells], cumulative[cells + 1]
    across = (within - edges[0]) / (edges[1] - edges[0])
    row_edges = row_starts[rows], row_starts[rows + 1]
    down = (points[:, 0] * cumulative[-1] - row_edges[0]) / (row_edges[1] - row_edges[0])
    directions = grid_to_direction(
        np.stack([columns + across - 0.5, rows + down - 0.5], axis=-1), height
    )
    density = light[rows, columns] / cumulative[-1]
    irradiance = environment.radiance[rows, columns] / (len(points) * density)[:, None]
    return directions, irradiance, cone_radius(1 / (len(points) * density))


def _median_parts(total: Array, region: Region) -> tuple[Region, Region] | None:
    """Return the halves of a region, cut across its longer side on the sphere; None of one cell."""
    top, bottom, left, right = region
    shrink = np.sin(np.pi * ((top + bottom) // 2 + 0.5) / (len(total) - 1))
    is_wide = (right - left) * shrink >= bottom - top or bottom - top == 1
    if right - left > 1 and is_wide:
        cut = left + _half(total[bottom, left : right + 1] - total[top, left : right + 1])
        return (top, bottom, left, cut), (top, bottom, cut, right)
    if bottom - top > 1:
        cut = top + _half(total[top : bottom + 1, right] - total[top : bottom + 1, left])
        return (top, cut, left, right), (cut, bottom, left, right)
    return None


def _half(sums: Array) -> int:
    """Return the interior index at which running sums (n + 1,) pass half their span."""
    middle = np.searchsorted(sums - sums[0], (sums[-1] - sums[0]) / 2)
    return int(np.clip(middle, 1, len(sums) - 2))


def _centroids(light: Array, weight: Array, regions: list[Region]) -> Lights:
    """Return a light at the centroid of each region that has any, as wide as its spread."""
    all_directions = cell_directions(len(weight))
    directions, irradiance, radius = [], [], []
    for top, bottom, left, right in regions:
        region = np.s_[top:bottom, left:right]
        centroid = np.einsum("rc,rcx->x", weight[region], all_directions[region])
        length = np.linalg.norm(centroid)
        if length > 0:
            directions.append(centroid / length)
            irradiance.append(light[region].sum(axis=(0, 1)))
            radius.append(np.arccos(np.clip(2 * length / weight[region].sum() - 1, 0, 1)))
    return np.array(directions), np.array(irradiance), np.array(radius)


@cache
def _mitsuba() -> Any:
    """Return Mitsuba. Its scalar variant: the vectorised one ends the process with some LLVMs."""
    mitsuba = import_module("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba
