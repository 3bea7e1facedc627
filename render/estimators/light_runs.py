"""The map's cells along a Hilbert curve, cut into runs: what lies close together comes together.

Runs are the blocks of a regular grid, those that hold light, and each stands for a direction: the
mean of where its light comes from. Even shares of the light along the curve are strata.

Cost   : 50 ms for a map of 512 × 1024.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere.latlong import cell_directions, solid_angles
from render.estimators.map_tables import place_in_cell
from render.reference.emitters import along_hilbert

Floats = NDArray[np.float32]

_ROWS = 16
"""Of blocks: each is 11° wide."""


class LightRuns(NamedTuple):
    """A map in runs.

    Attributes
    ----------
    radiance : (N, 2N, 3) float32
    cells : (J,) int64
        Flat indices of those that hold light, in the order of the curve.
    cumulative : (J,) float64
        Share of each run's light in its cells up to each; the last of a run is 1.
    density : (J,) float64
        Share of a run's light that a cell has, per sr.
    starts : (B + 1,) int64
        First cell of each run.
    power : (B,) float64
        ∫ luminance over each run.
    directions : (B, 3) float32
        Unit vectors.
    radius_rad : float
        About from the middle of a run to its corner.
    """

    radiance: Floats
    cells: NDArray[np.int64]
    cumulative: NDArray[np.float64]
    density: NDArray[np.float64]
    starts: NDArray[np.int64]
    power: NDArray[np.float64]
    directions: Floats
    radius_rad: float


def light_runs(environment: EnvironmentMap) -> LightRuns:
    """Return the runs of a map; none of one without light."""
    height = environment.height
    brightness = luminance(environment.radiance).ravel()
    power = brightness * np.repeat(solid_angles(height), 2 * height)
    cells = np.flatnonzero(power)
    row, column = np.divmod(cells, 2 * height)
    order = np.argsort(along_hilbert(row, column, height))
    cells, row, column = cells[order], row[order], column[order]
    wide = 1 << max((height - 1).bit_length() - _ROWS.bit_length() + 1, 0)
    block = row // wide * (2 * height) + column // wide
    is_first = np.concatenate([[True], np.diff(block) != 0]) if len(block) else np.zeros(0, bool)
    starts = np.append(np.flatnonzero(is_first), len(cells))
    lengths = np.diff(starts)
    of_cell = power[cells]
    if not len(cells):
        none = np.zeros(0)
        return LightRuns(
            environment.radiance, cells, none, none, starts, none, np.zeros((0, 3), np.float32), 1.0
        )
    run_power = np.add.reduceat(of_cell, starts[:-1])
    summed = np.cumsum(of_cell)
    before = np.repeat(summed[starts[:-1]] - of_cell[starts[:-1]], lengths)
    cumulative = (summed - before) / np.repeat(run_power, lengths)
    cumulative[starts[1:] - 1] = 1.0
    toward = cell_directions(height).reshape(-1, 3)[cells]
    mean = np.add.reduceat(of_cell[:, None] * toward, starts[:-1])
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    steps = np.diff(cumulative, prepend=0.0)
    steps[starts[:-1]] = cumulative[starts[:-1]]  # what is drawn, as it was rounded
    return LightRuns(
        environment.radiance,
        cells,
        cumulative,
        steps / np.repeat(solid_angles(height), 2 * height)[cells],
        starts,
        run_power,
        mean.astype(np.float32),
        math.pi / height * wide / math.sqrt(2),
    )


@njit(nogil=True, error_model="numpy", forceinline=True)
def draw_from_run(
    runs: LightRuns, run: int, share: float, v: float
) -> tuple[int, float, float, float]:  # pragma: no cover - compiled
    """Return the place along the curve and the direction of a share in [0, 1) of a run's light."""
    low, high = runs.starts[run] - 1, runs.starts[run + 1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        is_above = runs.cumulative[middle] > share
        low, high = (low, middle) if is_above else (middle, high)
    below = runs.cumulative[high - 1] if high > runs.starts[run] else 0.0
    u = (share - below) / (runs.cumulative[high] - below)
    height = runs.radiance.shape[0]
    row, column = divmod(runs.cells[high], 2 * height)
    x, y, z = place_in_cell(row, column, height, u, v)
    return high, x, y, z
