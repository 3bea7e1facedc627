"""Key lights, a fill, and cells for the rest, as few as it takes, remembered from frame to frame.

Concentrated sources become key lights (key_lights.py). What is smooth goes into a fill
(smooth_fill.py), and what is left into the lights of a tree of cells (cell_tree.py), each at the
exact centroid of its light and as wide as its spread. Which fill, and if asked how many lights, is
decided by the error that they are predicted to make (prediction.py). With the memory of the last
frame, key lights are looked for where they were, cuts stay while they are nearly as good, and a
light stays where it is while its centroid moves less than a small part of its width.

Domain : world frame; blocks of a lat-long grid (summed_area.py, block_grid.py).
Cost   : see tests/benchmarks; the first frame tries every fill, later ones two.
Fails  : sources that are neither narrow nor alone in their cell are one wide light; a cell's light
         slides between two of them as they change (tests/limits/test_adaptive_dim_lamps.py).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lighting import harmonics, prediction
from lighting.block_grid import BlockGrid, block_grid, coarsened
from lighting.cell_tree import EMPTY_TREE, CellTree, grow_tree, tree_sums
from lighting.environment import EnvironmentMap
from lighting.key_lights import MOST_KEY_LIGHTS, take_key_lights
from lighting.smooth_fill import FillShape, fit_fill, less_fill
from lighting.summed_area import block_sums, summed_area_tables

Array = NDArray[np.float64]

SHAPES = tuple(FillShape(order, weight) for order in (0, 1, 2) for weight in (1000.0, 100.0, 10.0))
MOST_LIGHTS_FOR_ERROR = 512
"""Where no fewer meet the asked error."""
SAFETY = 1.5
"""An error is met when it is predicted to be this many times smaller."""
_BETTER = 0.85
"""Another fill is taken when its error, or count of lights, is at most this part of today's."""
_FEWER = 0.75
"""Lights are given up when this part of them is enough."""
_BACKLASH = 0.05
"""Part of a light's angular radius that its centroid may be off before it follows."""
_KEY_ROWS = 128
_FAINT = 1e-7
_FRAMES_PER_TRY = 4
"""Another fill is tried in every so many frames."""


@dataclass(frozen=True, eq=False)
class Memory:
    """What one frame leaves to the next.

    Attributes
    ----------
    rows : int
        Rows of the blocks that were cut into cells.
    shape : FillShape
    turn : int
        Frames so far: which other fill is tried next.
    key_directions : (k, 3) float64
    tree : CellTree
        Cells of the lights that were returned.
    directions : (n, 3) float64
        Where the light of each cell of the tree stands, or would.
    """

    rows: int
    shape: FillShape
    turn: int
    key_directions: Array
    tree: CellTree
    directions: Array


NO_FILL = np.zeros((harmonics.COUNT, 3))
NO_FILL.flags.writeable = False


class Reduced(NamedTuple):
    """Lights of one frame; key lights come first.

    Attributes
    ----------
    directions, irradiance : (n, 3) float64
    angular_radius_rad : (n,) float64
    key_count : int
    fill : (9, 3) float64
    predicted_error : float or None
    block_rows : int or None
        As in LightSet.
    """

    directions: Array
    irradiance: Array
    angular_radius_rad: Array
    key_count: int = 0
    fill: Array = NO_FILL
    predicted_error: float | None = None
    block_rows: int | None = None


@dataclass(frozen=True, eq=False)
class _Candidate:
    """Lights for every count, with one fill."""

    shape: FillShape
    tree: CellTree
    was: NDArray[np.int64]
    directions: Array
    irradiance: Array
    radius: Array
    fill: Array
    shortage: Array  # (n, 3), of the fill's integral
    errors: Array  # of 0, 1, … lights


def adaptive(environment: EnvironmentMap, count: int) -> Reduced:
    """Return at most `count` lights, and a fill, for a map by itself.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, key lights included, at least 1. Fewer are returned if lights and fill
        hold all the light with fewer: none for a map of one colour.
    """
    blocks = block_sums(environment.radiance)
    return adaptive_next(blocks, block_grid(environment.height), count)[0]


def adaptive_of_blocks(blocks: Array, count: int) -> Reduced:
    """Return what `adaptive` does, from sums over blocks (rows, 2 rows, 7)."""
    return adaptive_next(blocks, block_grid(len(blocks)), count)[0]


def adaptive_next(
    blocks: Array,
    grid: BlockGrid,
    count: int,
    *,
    error: float | None = None,
    memory: Memory | None = None,
) -> tuple[Reduced, Memory | None]:
    """Return lights for the blocks of a map, and what to remember of them.

    Parameters
    ----------
    blocks : (rows, columns, 7) float64
        As from `summed_area.block_sums`.
    grid : BlockGrid
        Of these blocks.
    count : int
        Number of lights, key lights included; with `error`, the most there may be.
    error : float or None
        Relative error behind occluders to be met with as few lights as will do.
    memory : Memory or None
        From the frame before, of a map of the same size.

    Notes
    -----
    Lights and fill together hold ∫L dω of each channel: where the fill is brighter than the map
    over a whole cell, which then has no light, the rest of the fill is dimmed by as much.
    """
    if not blocks[..., 0].any():
        nothing = np.empty((0, 3))
        return Reduced(nothing, nothing, np.empty(0)), None
    rows = 64 if count <= 64 or error else 128 if count <= 256 else 256
    if memory is not None and memory.rows != min(rows, grid.rows):
        memory = None
    key_rows = max(rows, _KEY_ROWS)
    least_share = error / 2 if error else max(0.005, 1 / (3 * count))
    fine = coarsened(blocks, key_rows)
    grid = grid.coarser(key_rows)
    keys = take_key_lights(
        fine,
        grid,
        least_share,
        min(MOST_KEY_LIGHTS, count // 2),
        memory.key_directions if memory else np.empty((0, 3)),
    )
    as_keys = prediction.responses(keys.directions, keys.angular_radius_rad)
    from_keys = as_keys.T @ keys.irradiance
    grid = grid.coarser(rows)
    rest = coarsened(keys.rest, rows)
    cells = count - len(keys.directions)

    received = prediction.map_responses(rest, grid)
    scale = float(np.sqrt(np.mean((received + from_keys) ** 2)))
    candidates = [
        _candidate(rest, grid, cells, shape, received, scale, memory)
        for shape in _shapes_to_try(memory)
    ]
    chosen, number = _choose(candidates, cells, error, memory)

    tree = chosen.tree.prefix(number)
    kept = tree.leaves()
    directions = _held(chosen, memory)
    irradiance = chosen.irradiance[kept]
    whole = rest[..., 4:].sum(axis=(0, 1))
    fill_integral = harmonics.integral(chosen.fill)
    # What is next to nothing, the fill may hold as well.
    faint = _FAINT * whole * (fill_integral > 0)
    lit = (irradiance > faint).any(axis=1)
    irradiance, kept = irradiance[lit], kept[lit]
    dimming = np.divide(
        whole - irradiance.sum(axis=0), fill_integral, out=np.zeros(3), where=fill_integral > 0
    )
    reduced = Reduced(
        np.concatenate([keys.directions, directions[kept]]),
        np.concatenate([keys.irradiance, irradiance]),
        np.concatenate([keys.angular_radius_rad, chosen.radius[kept]]),
        len(keys.directions),
        chosen.fill * np.maximum(dimming, 0.0),
        float(chosen.errors[number]),
        grid.rows,
    )
    turn = memory.turn + 1 if memory else 0
    left = Memory(
        grid.rows, chosen.shape, turn, keys.directions, tree, directions[: len(tree.cuts)]
    )
    return reduced, left


def _shapes_to_try(memory: Memory | None) -> tuple[FillShape, ...]:
    """Return the fills to compare: at first all, then today's and now and then another."""
    if memory is None:
        return SHAPES
    turn, is_next = divmod(memory.turn, _FRAMES_PER_TRY)
    other = SHAPES[turn % len(SHAPES)]
    return (memory.shape, other) if not is_next and other != memory.shape else (memory.shape,)


def _candidate(
    rest: Array,
    grid: BlockGrid,
    count: int,
    shape: FillShape,
    received: Array,
    scale: float,
    memory: Memory | None,
) -> _Candidate:
    fill = fit_fill(rest, grid, shape)
    left, positive = less_fill(rest, grid, fill)
    moments, lit = summed_area_tables(positive)
    before = memory.tree if memory and memory.shape == shape else EMPTY_TREE
    tree, was = grow_tree(moments, lit, count, before)
    sums = tree_sums(left, tree)
    directions, irradiance, radius = _lights(sums, tree_sums(positive, tree))
    fill_integral = harmonics.integral(fill)
    shortage = np.divide(
        irradiance - sums[:, 4:],
        fill_integral,
        out=np.zeros_like(irradiance),
        where=fill_integral > 0,
    )
    from_fill = prediction.fill_responses(fill, grid)
    errors = prediction.errors_by_count(
        tree.first_part,
        irradiance,
        prediction.responses(directions, radius),
        received,
        from_fill,
        shortage,
        scale,
    )
    whole = rest[..., 4:].sum(axis=(0, 1))
    gain = np.divide(whole, fill_integral, out=np.zeros(3), where=fill_integral > 0)
    without = float(np.sqrt(np.mean((received - from_fill * gain) ** 2))) / scale
    return _Candidate(
        shape, tree, was, directions, irradiance, radius, fill, shortage, np.append(without, errors)
    )


def _lights(sums: Array, positive: Array) -> tuple[Array, Array, Array]:
    """Return directions, irradiance and radii of cells from what the fill leaves of them.

    Of a cell that the fill leaves more than a trace of, the light stands at the exact centroid, so
    that a surface that sees all of the cell receives exactly its light; otherwise at the centroid
    of the positive part.
    """
    power, moment = sums[:, 0], sums[:, 1:4]
    length = np.linalg.norm(moment, axis=1)
    is_plain = (power > 1e-3 * positive[:, 0]) & (length <= power)
    power = np.where(is_plain, power, positive[:, 0])
    moment = np.where(is_plain[:, None], moment, positive[:, 1:])
    length = np.linalg.norm(moment, axis=1)
    directed = length > 1e-9 * power
    directions = np.tile([0.0, 1.0, 0.0], (len(sums), 1))
    directions[directed] = moment[directed] / length[directed, None]
    resultant = np.divide(length, power, out=np.ones_like(power), where=power > 0)
    return directions, np.maximum(sums[:, 4:], 0.0), np.arccos(np.clip(2 * resultant - 1, 0.0, 1.0))


def _choose(
    candidates: list[_Candidate], most: int, error: float | None, memory: Memory | None
) -> tuple[_Candidate, int]:
    """Return the candidate to take, and its number of lights; the first is today's."""
    if error is None:
        numbers = [min(most, len(c.errors) - 1) for c in candidates]
        costs = [float(c.errors[n]) for c, n in zip(candidates, numbers, strict=True)]
    else:
        numbers = [_fewest(c.errors, error / SAFETY, memory) for c in candidates]
        # Of as many lights, the fill of the lower order.
        costs = [n + c.shape.order / 4 for c, n in zip(candidates, numbers, strict=True)]
    best = int(np.argmin(costs))
    if memory is not None and costs[best] > _BETTER * costs[0]:
        best = 0
    return candidates[best], numbers[best]


def _fewest(errors: Array, error: float, memory: Memory | None) -> int:
    """Return the fewest lights that meet an error; as many as before while not far fewer would."""
    met = np.flatnonzero(errors <= error)
    fewest = int(met[0]) if len(met) else len(errors) - 1
    if memory is not None:
        before = len(memory.tree.leaves())
        if before < len(errors) and errors[before] <= error and fewest > _FEWER * before:
            return before
    return fewest


def _held(candidate: _Candidate, memory: Memory | None) -> Array:
    """Return where the light of each cell stands: its centroid, but for the backlash."""
    directions = candidate.directions
    if memory is None or memory.shape != candidate.shape:
        return directions
    held = directions.copy()
    stays = candidate.was >= 0
    before = memory.directions[candidate.was[stays]]
    chord = directions[stays] - before
    distance = np.linalg.norm(chord, axis=1)
    slack = _BACKLASH * candidate.radius[stays]
    part = np.where(distance > slack, 1 - slack / np.maximum(distance, 1e-300), 0.0)
    moved = before + part[:, None] * chord
    held[stays] = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    # Not moved at all, to the bit, where it need not.
    held[np.flatnonzero(stays)[part == 0]] = before[part == 0]
    return held
