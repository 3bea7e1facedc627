"""The fill: the smooth light of a map, in harmonics of order 2 or less, that needs no light.

The fill lies under the map, as far as a few coefficients can: a least-squares fit in which being
too bright weighs more than being too dark. Lights then stand for the rest.

Domain : world frame; blocks of a lat-long grid (summed_area.py, block_grid.py).
Cost   : nine small fits over at most 512 coarse blocks.
Fails  : where the map is dark in one place, a wall or a ground without light, the fill is either
         dark everywhere or too bright there; `overshoot_weight` says which.

References
----------
.. [1] W. K. Newey, J. L. Powell, "Asymmetric Least Squares Estimation and Testing", Econometrica,
       1987: expectiles by reweighting.
.. [2] O. Karlík, M. Šik, P. Vévoda, T. Skřivan, J. Křivánek, "MIS Compensation", SIGGRAPH Asia,
       2019: lights for what is above the mean, something smooth for the rest.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.block_grid import BlockGrid, coarsened
from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere import harmonics

Array = NDArray[np.float64]

FIT_ROWS = 16
"""Rows of the coarse blocks that the fill is fitted to."""
_ROUNDS = 8
_BRIGHTEST = 4.0
"""Blocks count as at most this many times the mean: what is brighter is no matter of the fill."""
_RIDGE = 1e-12


@dataclass(frozen=True)
class FillShape:
    """What a fill may be.

    Attributes
    ----------
    order : int
        Highest degree, 0 to 2.
    overshoot_weight : float
        Weight of being too bright against being too dark, above 1.
    """

    order: int
    overshoot_weight: float


def fit_fill(blocks: Array, grid: BlockGrid, shape: FillShape) -> Array:
    """Return coefficients (9, 3) of the fill of a map, nowhere negative.

    Parameters
    ----------
    blocks : (rows, columns, 7) float64
    grid : BlockGrid
        Of these blocks.
    shape : FillShape
    """
    coarse = grid.coarser(FIT_ROWS)
    solid_angle = coarse.area[..., 0].ravel()
    count = (shape.order + 1) ** 2
    functions = np.ascontiguousarray(coarse.functions.reshape(-1, harmonics.COUNT)[:, :count])
    radiance = coarsened(blocks, FIT_ROWS)[..., 4:].reshape(-1, 3) / solid_angle[:, None]
    coefficients = np.zeros((harmonics.COUNT, 3))
    coefficients[:count] = _asymmetric_fit(functions, solid_angle, radiance, shape.overshoot_weight)
    coefficients[:, coefficients[0] <= 0] = 0.0
    return harmonics.windowed(coefficients)


def less_fill(blocks: Array, grid: BlockGrid, fill: Array) -> tuple[Array, Array]:
    """Return what a fill leaves of blocks to the lights.

    Returns
    -------
    rest : (rows, columns, 7) float64
        The blocks less those of the fill; below 0 where the fill is brighter.
    positive : (rows, columns, 4) float64
        ∫Y dω and ∫Y d dω of the blocks, each coarse block with the share of its luminance that the
        fill does not take, none where that is negative. Signs are told over coarse blocks, so that
        noise and texture are not rectified into light.
    """
    used = int(np.flatnonzero(fill.any(axis=1)).max(initial=0)) + 1
    rest, positive = np.empty_like(blocks), np.empty((*blocks.shape[:2], 4))
    factor = -(-grid.rows // FIT_ROWS)
    _subtract(blocks, grid.area, grid.functions, fill[:used], factor, rest, positive)
    return rest, positive


@njit(cache=True, nogil=True)
def _subtract(blocks, area, functions, fill, factor, rest, positive):  # type: ignore[no-untyped-def]
    red, green, blue = LUMINANCE_WEIGHTS
    rows, columns, _ = blocks.shape
    before = np.zeros((-(-rows // factor), -(-columns // factor)))
    left = np.zeros_like(before)
    for r in range(rows):
        for c in range(columns):
            fill_r = fill_g = fill_b = 0.0
            for k in range(len(fill)):
                fill_r += functions[r, c, k] * fill[k, 0]
                fill_g += functions[r, c, k] * fill[k, 1]
                fill_b += functions[r, c, k] * fill[k, 2]
            luminance = red * fill_r + green * fill_g + blue * fill_b
            for k in range(4):
                rest[r, c, k] = blocks[r, c, k] - luminance * area[r, c, k]
            rest[r, c, 4] = blocks[r, c, 4] - fill_r * area[r, c, 0]
            rest[r, c, 5] = blocks[r, c, 5] - fill_g * area[r, c, 0]
            rest[r, c, 6] = blocks[r, c, 6] - fill_b * area[r, c, 0]
            before[r // factor, c // factor] += blocks[r, c, 0]
            left[r // factor, c // factor] += rest[r, c, 0]
    for r in range(rows):
        for c in range(columns):
            whole, part = before[r // factor, c // factor], left[r // factor, c // factor]
            share = part / whole if part > 0 and whole > 0 else 0.0
            for k in range(4):
                positive[r, c, k] = share * blocks[r, c, k]


@njit(cache=True, nogil=True)
def _asymmetric_fit(functions, solid_angle, radiance, overshoot_weight):  # type: ignore[no-untyped-def]
    """Return coefficients (k, C) of the weighted fits, each channel by itself."""
    number, count = functions.shape
    channels = radiance.shape[1]
    coefficients = np.zeros((count, channels))
    total = solid_angle.sum()
    values = np.empty(number)
    for channel in range(channels):
        most = _BRIGHTEST * (radiance[:, channel] * solid_angle).sum() / total
        if most == 0.0:
            continue
        for i in range(number):
            values[i] = min(radiance[i, channel], most)
        is_over = np.zeros(number, np.bool_)
        normal = np.zeros((count, count))
        right = np.zeros(count)
        for i in range(number):
            _add_block(normal, right, functions, i, values[i], solid_angle[i])
        for k in range(count):
            normal[k, k] += _RIDGE
        for _ in range(_ROUNDS):
            solution = np.linalg.solve(normal, right)
            is_settled = True
            for i in range(number):  # BLAS would wake its threads for this
                fit = 0.0
                for k in range(count):
                    fit += functions[i, k] * solution[k]
                if is_over[i] != (fit > values[i]):
                    is_over[i] = not is_over[i]
                    more = overshoot_weight - 1.0 if is_over[i] else 1.0 - overshoot_weight
                    _add_block(normal, right, functions, i, values[i], solid_angle[i] * more)
                    is_settled = False
            if is_settled:
                break
        coefficients[:, channel] = solution
    return coefficients


@njit(cache=True, nogil=True)
def _add_block(normal, right, functions, i, value, weight):  # type: ignore[no-untyped-def]
    """Add block i to the normal equations of a fit."""
    for k in range(len(right)):
        weighted = weight * functions[i, k]
        right[k] += weighted * value
        for m in range(len(right)):
            normal[k, m] += weighted * functions[i, m]
