"""Passes over a picture by any estimator, for `reference.accumulation` to add up.

A pass sees each pixel through n × n points, one in each square of its area, and estimates each
point's light on its own. Pixels are taken in bands, so that what is kept of a picture is small.

Input  : a scene, a camera, a map or lights; the name of an estimator.
Output : independent estimates of every pixel.
Fails  : lights are drawn into a map of 512 rows: the sun then is a few cells wide.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.estimators.contract import Estimate, Floats, Memory, Setting, Shadows
from render.estimators.registry import ESTIMATORS, PATHS
from render.lights.light_map import map_of_lights
from render.rays.embree import (
    PACKET,
    Occluders,
    hit_packet,
    intersect16_address,
    occluded16_address,
)
from render.reference.accumulation import AddPass, Progress, accumulate, nothing_yet
from render.reference.passes import Sums
from render.reference.pixel_rays import SIDE, aim, mixed, view_of
from render.reference.surfaces import FIELDS, HIT, Tables, find_surfaces, scene_tables
from render.reference.tracing import ReferencePicture, picture_of
from render.scenes.scene import Camera, Scene

SAMPLES = 16
"""Directions that are drawn for each point of a pixel, unless others are asked for."""

_POINTS_SIDE = 2
_BAND_PACKETS = 4096
_LIGHT_ROWS = 512
_MOST_FACTOR = 64


def estimate_picture(
    name: str,
    scene: Scene,
    camera: Camera,
    light: EnvironmentMap | LightSet,
    *,
    error: float = 0.01,
    seconds: float = math.inf,
    samples: int = SAMPLES,
    bounces: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
    on_pass: Callable[[Progress], None] | None = None,
) -> ReferencePicture:
    """Return the picture of `scene` by an estimator, as exact as asked for.

    As `reference.tracing.render_reference`. Estimators that err in the same way in every pass, for
    they leave something out (`registry.UNBIASED` has the others), err by more than they tell.

    Parameters
    ----------
    name : str
        A key of `ESTIMATORS`.
    samples : int
        Directions drawn for each of four points of a pixel in a pass; later passes may draw more.
    bounces : int
        Surfaces that light may meet: 1 for direct light, more for `registry.PATHS` alone.

    Raises
    ------
    InputError
        If there is no such estimator, or it does not follow light to so many surfaces.
    """
    progress = nothing_yet(camera.size_px) if progress is None else progress
    with passes_of(
        name, scene, camera, light, samples=samples, bounces=bounces, seed=seed,
        memory=progress.memory,
    ) as add:  # fmt: skip
        accumulate(
            add, progress, error=error, seconds=seconds, most_factor=_MOST_FACTOR, on_pass=on_pass
        )
    return picture_of(progress)


@contextmanager
def passes_of(
    name: str,
    scene: Scene,
    camera: Camera,
    light: EnvironmentMap | LightSet,
    *,
    samples: int = SAMPLES,
    bounces: int = 1,
    seed: int = 0,
    memory: Memory | None = None,
) -> Iterator[AddPass]:
    """Give what adds passes by an estimator, for `accumulate`; parameters as `estimate_picture`.

    `memory` is as `contract.Setting` has it.
    """
    if name not in ESTIMATORS:
        raise InputError(f"no estimator is called {name!r}; there are: {', '.join(ESTIMATORS)}")
    if bounces < 1 or (bounces > 1 and name != PATHS):
        raise InputError(
            f"light meets 1 surface, or as many as it should with the estimator {PATHS!r}; "
            f"got {bounces} with {name!r}"
        )
    tables = scene_tables(scene)
    environment = map_of_lights(light, _LIGHT_ROWS) if isinstance(light, LightSet) else light
    lowest = -2.0
    if scene.ground is not None:
        lowest = 0.0
        environment = _upper_half(environment)
    view = view_of(camera)
    with Occluders(tables.positions, tables.faces, is_watertight=False) as occluders:
        shadows = Shadows(occluded16_address(), occluders.address, tables.sphere, lowest)
        estimate = ESTIMATORS[name](Setting(environment, shadows, tables, bounces, memory))

        def add(number: int, factor: int, sums: Sums) -> None:
            each = int(np.random.default_rng([seed, number]).integers(1 << 62))
            _add_bands(estimate, occluders.address, view, tables, factor * samples, each, sums)

        yield add


def _add_bands(
    estimate: Estimate,
    address: int,
    view: Floats,
    tables: Tables,
    samples: int,
    seed: int,
    sums: Sums,
) -> None:
    """Add an estimate of every pixel to `sums`."""
    height, width = sums.radiance.shape[:2]
    columns, rows = -(-width // SIDE), -(-height // SIDE)
    band = max(_BAND_PACKETS // columns, 1)
    points = _POINTS_SIDE**2
    for first in range(0, rows, band):
        packets = columns * min(band, rows - first)
        surfaces = np.empty((packets, FIELDS, PACKET), np.float32)
        radiance = np.zeros((packets, 3, PACKET), np.float32)
        covered = np.zeros((packets, PACKET), np.float32)
        for point in range(points):
            random = (seed + (first * points + point) * 0x9E3779B97F4A7C15) % (1 << 62)
            _see(
                intersect16_address(), address, view, tables, (width, height), first, point,
                random, surfaces, covered,
            )  # fmt: skip
            sums.rays[first] += estimate(surfaces, samples, random, radiance)
        _add_up(first, radiance, covered, points, sums)


@njit(cache=True, nogil=True, parallel=True)
def _see(
    function: int,
    scene: int,
    view: Floats,
    tables: Tables,
    size_px: tuple[int, int],
    first: int,
    point: int,
    seed: int,
    surfaces: Floats,
    covered: Floats,
) -> None:  # pragma: no cover - compiled
    """Set `surfaces` (P, FIELDS, 16) to what pixels show from row of tiles `first` on."""
    width, height = size_px
    columns = (width + SIDE - 1) // SIDE
    for row in prange(len(surfaces) // columns):
        hits, in_picture = hit_packet()
        for column in range(columns):
            k = row * columns + column
            x, y = SIDE * column, SIDE * (first + row)
            random = mixed(mixed(np.uint64(seed)) ^ np.uint64(y << 32 | x))
            in_picture[:] = aim(view, x, y, width, height, _POINTS_SIDE, point, random, hits)
            find_surfaces(function, scene, tables, hits, in_picture, surfaces[k])
            covered[k] += surfaces[k, HIT]


@njit(cache=True, nogil=True)
def _add_up(
    first: int, radiance: Floats, covered: Floats, points: int, sums: Sums
) -> None:  # pragma: no cover - compiled
    height, width = sums.radiance.shape[:2]
    columns = (width + SIDE - 1) // SIDE
    for k in range(len(radiance)):
        row, column = first + k // columns, k % columns
        for i in range(PACKET):
            y, x = SIDE * row + i // SIDE, SIDE * column + i % SIDE
            if y < height and x < width:
                for c in range(4):
                    value = np.float64(radiance[k, c, i] if c < 3 else covered[k, i]) / points
                    sums.radiance[y, x, c] += value
                    sums.squares[y, x, c] += value * value


def _upper_half(environment: EnvironmentMap) -> EnvironmentMap:
    """Return a map that is black in the rows below the horizon."""
    radiance: NDArray[np.float32] = environment.radiance.copy()
    radiance[(environment.height + 1) // 2 :] = 0.0
    return replace(environment, radiance=radiance)
