"""Where light comes from: a map's cells and discs, and directions drawn by their luminance.

A pool of directions stands for all light: drawn evenly by luminance × solid angle, and sorted along
a Hilbert curve over the map, so that any run of them lies close together. Dividing it into equal
runs makes strata of equal power.

Domain : world frame, lat-long grid (CONVENTIONS.md), radiance constant over each cell of the map.
Input  : EnvironmentMap or LightSet.    Output : directions, weights and densities.
Cost   : about 20 ms for 65,536 directions.
Fails  : a set's fill is taken as constant over cells of 1.4°, an error of about 1e-4.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap, luminance
from lighting.sphere import harmonics
from lighting.sphere.latlong import (
    cell_directions,
    direction_to_grid,
    grid_to_direction,
    solid_angles,
)

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

_FILL_ROWS = 128
_SMALLEST_RADIUS_RAD = 1e-4  # as discs.py has it: narrower discs are points
_POINT_DENSITY = 1e30  # per sr: beyond what any lobe has


class Emitters(NamedTuple):
    """All light that reaches a scene.

    Attributes
    ----------
    radiance : (N, 2N, 3) float32
        Of the map's cells.
    density : (N, 2N) float32
        At which directions are drawn from each, per sr.
    discs : (K, 8) float32
        Direction of the centre (3), squared chord of the radius, radiance (3, 0 for a point), and
        the density at which directions are drawn from it, per sr.
    colour : (C, 3) float64
        Of what directions are drawn from, cells and then discs: radiance over its luminance.
    source : (J,) int64
        What directions are drawn from, in the order of the curve: rows of `colour`.
    cumulative : (J,) float64
        Sum of power up to each; power is luminance × solid angle.
    lowest : float
        From directions whose y is not above this no light comes.
    """

    radiance: Floats
    density: Floats
    discs: Floats
    colour: Array
    source: NDArray[np.int64]
    cumulative: Array
    lowest: float

    @property
    def power(self) -> float:
        """∫ of luminance over all directions."""
        return float(self.cumulative[-1]) if len(self.cumulative) else 0.0


def emitters_of(light: EnvironmentMap | LightSet, *, above_horizon: bool) -> Emitters:
    """Return what a map or set consists of; with `above_horizon`, what is of it above."""
    if isinstance(light, EnvironmentMap):
        radiance = light.radiance.astype(np.float64)
        centres, irradiance, radius_rad = np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    else:
        at = cell_directions(_FILL_ROWS)
        radiance = np.maximum(harmonics.evaluate(light.fill, at), 0.0)
        centres, irradiance = light.directions, light.irradiance
        radius_rad = light.angular_radius_rad
    height = len(radiance)
    radius_rad = np.where(radius_rad < _SMALLEST_RADIUS_RAD, 0.0, radius_rad)
    if above_horizon:
        radiance = radiance.copy()
        radiance[(height + 1) // 2 :] = 0.0
        keep = np.arcsin(np.clip(centres[:, 1], -1, 1)) > -radius_rad
        centres, irradiance, radius_rad = centres[keep], irradiance[keep], radius_rad[keep]

    brightness = np.concatenate([luminance(radiance).ravel(), irradiance @ LUMINANCE_WEIGHTS])
    power = brightness.copy()
    power[: 2 * height**2] *= np.repeat(solid_angles(height), 2 * height)
    source = np.flatnonzero(power)
    column, row = np.rint(direction_to_grid(centres, height)).astype(np.int64).T
    rows, columns = np.divmod(np.arange(2 * height**2), 2 * height)
    along = along_hilbert(np.concatenate([rows, row]), np.concatenate([columns, column]), height)
    source = source[np.argsort(along[source], kind="stable")]
    cumulative = np.cumsum(power[source])
    whole = cumulative[-1] if len(source) else 1.0

    solid_angle = 4 * np.pi * np.sin(0.5 * radius_rad) ** 2
    is_point = solid_angle == 0
    solid_angle[is_point] = 1.0
    density = np.where(
        is_point, _POINT_DENSITY, irradiance @ LUMINANCE_WEIGHTS / solid_angle / whole
    )
    of_discs = np.where(is_point, 0.0, 1 / solid_angle)[:, None] * irradiance
    chord2 = 4 * np.sin(0.5 * radius_rad) ** 2
    colour = np.concatenate([radiance.reshape(-1, 3), irradiance])
    return Emitters(
        radiance.astype(np.float32),
        (luminance(radiance) / whole).astype(np.float32),
        np.column_stack([centres, chord2, of_discs, density]).astype(np.float32),
        colour / np.where(brightness == 0, 1.0, brightness)[:, None],
        source,
        cumulative,
        0.0 if above_horizon else -2.0,
    )


def draw_pool(emitters: Emitters, count: int, rng: np.random.Generator) -> Floats:
    """Return directions drawn from emitters, in the order of the curve; zeros if all is dark.

    Returns
    -------
    (count, 8) float32
        Direction (3); weight (3), its radiance over the density at which it is drawn; that density
        per sr, of the cell or disc it is drawn from; 0.
        Of any function f(direction), the mean of weight × f is ∫ L f dω.
    """
    pool = np.zeros((count, 8), np.float32)
    if not emitters.power:
        return pool
    share = (np.arange(count) + rng.random(count)) / count
    found = np.searchsorted(emitters.cumulative, share * emitters.power, side="right")
    source = emitters.source[np.minimum(found, len(emitters.source) - 1)]
    height = len(emitters.radiance)
    cells = 2 * height * height
    u, v = rng.random((2, count))
    pool[:, 3:6] = emitters.power * emitters.colour[source]

    in_cell = source < cells
    row, column = np.divmod(source[in_cell], 2 * height)
    above, below = np.cos(np.pi * row / height), np.cos(np.pi * (row + 1) / height)
    theta = np.arccos(above + u[in_cell] * (below - above))
    at = np.stack([column - 0.5 + v[in_cell], height * theta / np.pi - 0.5], axis=-1)
    pool[in_cell, :3] = grid_to_direction(at, height)
    pool[in_cell, 6] = emitters.density.ravel()[source[in_cell]]

    disc = emitters.discs[source[~in_cell] - cells].astype(np.float64)
    pool[~in_cell, :3] = _in_discs(disc[:, :3], disc[:, 3], u[~in_cell], v[~in_cell])
    pool[~in_cell, 6] = disc[:, 7]
    pool[pool[:, 1] <= emitters.lowest, 3:6] = 0.0  # the lower part of what straddles the horizon
    return pool


def _in_discs(centres: Array, chord2: Array, u: Array, v: Array) -> Array:
    """Return a direction in each disc (n, 3), even in solid angle as u and v are in [0, 1)."""
    lowered = 0.5 * chord2 * u  # 1 − cos of the angle to the centre
    level = np.sqrt(lowered * (2 - lowered))
    flattest = np.eye(3)[np.argmin(np.abs(centres), axis=1)]
    side = np.cross(centres, flattest)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    across = np.cross(centres, side)
    turn = 2 * np.pi * v
    return (
        (1 - lowered)[:, None] * centres
        + (level * np.cos(turn))[:, None] * side
        + (level * np.sin(turn))[:, None] * across
    )


def along_hilbert(
    row: NDArray[np.int64], column: NDArray[np.int64], height: int
) -> NDArray[np.int64]:
    """Return the places of cells of an N × 2N grid along a Hilbert curve."""
    bits = (2 * height - 1).bit_length()
    x, y = row, column % (2 * height)
    along = np.zeros_like(x)
    for bit in reversed(range(bits)):
        right, up = (x >> bit) & 1, (y >> bit) & 1
        along = 4 * along + ((3 * right) ^ up)
        last = (1 << bit) - 1
        x, y = x & last, y & last
        # The quarters below stand on their side; that on the right is turned over as well.
        lower, over = up == 0, (up == 0) & (right == 1)
        x, y = np.where(over, last - x, x), np.where(over, last - y, y)
        x, y = np.where(lower, y, x), np.where(lower, x, y)
    return along


@njit(nogil=True)
def arriving(
    emitters: Emitters, x: float, y: float, z: float, density: float, out: Floats
) -> None:  # pragma: no cover - compiled
    """Set `out` (3,) to the radiance from (x, y, z), times the share of another sampling in it.

    The share is density / (density + the pool's), for each cell or disc by itself: the balance
    heuristic. `density` is the other one's, in directions per sr and direction of the pool.
    """
    radiance, discs = emitters.radiance, emitters.discs
    height = radiance.shape[0]
    theta = math.atan2(math.sqrt(x * x + z * z), y)
    phi = math.atan2(x, z)
    row = min(int(theta * (height / math.pi)), height - 1)
    column = int((math.pi - phi) * (height / math.pi)) % (2 * height)
    share = density / (density + emitters.density[row, column])
    for c in range(3):
        out[c] = share * radiance[row, column, c]
    for k in range(discs.shape[0]):
        dx, dy, dz = x - discs[k, 0], y - discs[k, 1], z - discs[k, 2]
        if dx * dx + dy * dy + dz * dz < discs[k, 3]:
            share = density / (density + discs[k, 7])
            for c in range(3):
                out[c] += share * discs[k, 4 + c]
