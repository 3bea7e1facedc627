"""A fill as lights: a dome of discs that never move, so that their shadow maps are drawn once.

Input  : harmonics of radiance (9, 3).    Output : lights, of the same directions for every fill.
Cost   : a matrix product a picture; the cells are laid out once, in 50 ms.
Fails  : a cell is drawn as the disc of its spread (tests/limits/test_render_soft_shadows.py). In
         the open irradiance is within 0.2 % (rms).
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lighting.measures.error_measures import spread_directions
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions, solid_angles

Array = NDArray[np.float64]

CELLS = 48
"""Over the sphere; half of them reach a scene with a ground, and each costs what a light does. The
picture of a sphere on the ground errs by 2.8, 2.1 and 1.7 % with 32, 48 and 64."""
_GRID_ROWS = 64  # even, so that the horizon is a border between its cells
_ROUNDS = 20


def dome_lights(fill: Array, *, upper_only: bool) -> tuple[Array, Array, Array]:
    """Return directions (D, 3), irradiance (D, 3) and angular radii (D,) that stand for a fill.

    All of them together have the fill's ∫L dω. No disc straddles the horizon.

    Parameters
    ----------
    fill : (9, 3) float64
        Harmonics of radiance (harmonics.py), nowhere negative.
    upper_only : bool
        Only those above the horizon, for a scene with a ground.
    """
    directions, radius_rad, response = _cells()
    part = slice(CELLS // 2 if upper_only else CELLS)
    irradiance = np.maximum(response @ fill, 0.0)  # next to zeros of the fill it can be below
    total = irradiance.sum(axis=0)
    irradiance *= np.divide(harmonics.integral(fill), total, out=np.zeros(3), where=total > 0)
    return directions[part], irradiance[part], radius_rad[part]


@cache
def _cells() -> tuple[Array, Array, Array]:
    """Return mean directions (D, 3), angular radii (D,) and irradiance per harmonic (D, 9).

    A cell is what lies nearest to one of the directions on its side of the horizon; those below
    are mirror images. Its disc has its mean resultant length (1 + cos a)/2, or touches the horizon.
    """
    upper = cell_directions(_GRID_ROWS)[: _GRID_ROWS // 2].reshape(-1, 3)
    solid_angle = np.repeat(solid_angles(_GRID_ROWS)[: _GRID_ROWS // 2], 2 * _GRID_ROWS)
    moments = solid_angle[:, None] * upper
    directions = spread_directions(CELLS)[: CELLS // 2]
    for _ in range(_ROUNDS):  # Lloyd's: every direction is the mean of its cell
        is_in = np.eye(CELLS // 2)[np.argmax(upper @ directions.T, axis=1)].T
        moment = is_in @ moments
        length = np.linalg.norm(moment, axis=1)
        directions = moment / length[:, None]
    spread_rad = np.arccos(2 * length / (is_in @ solid_angle) - 1)
    radius_rad = np.tile(np.minimum(spread_rad, np.arcsin(directions[:, 1])), 2)
    mirror = np.array([1.0, -1.0, 1.0])
    directions = np.concatenate([directions, directions * mirror])
    response = np.concatenate(
        [(is_in * solid_angle) @ harmonics.basis(half) for half in (upper, upper * mirror)]
    )
    return directions, radius_rad, response @ np.linalg.inv(_seen(directions, radius_rad, response))


def _seen(directions: Array, radius_rad: Array, response: Array) -> Array:
    """Return the harmonics that discs have which stand for each harmonic, (9, 9).

    A disc of unit ∫L dω has the zonal harmonics 1, (1 + cos a)/2 and cos a (1 + cos a)/2 of a
    point's. What cells lose of the fill's differences, its inverse gives back: in the open, then,
    irradiance errs only by harmonics above order 2.
    """
    cosine = np.cos(radius_rad)
    zonal = np.stack([np.ones_like(cosine), (1 + cosine) / 2, cosine * (1 + cosine) / 2], axis=-1)
    degree = np.floor(np.sqrt(np.arange(harmonics.COUNT))).astype(int)
    return (harmonics.basis(directions) * zonal[:, degree]).T @ response
