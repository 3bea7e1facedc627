"""Key lights, a fill, and cells for the rest, as few as it takes, remembered from frame to frame.

Concentrated sources become key lights (key_lights.py). What is smooth goes into a fill
(smooth_fill.py), and what is left into the lights of a tree of cells (cell_tree.py), each at the
exact centroid of its light and as wide as its spread. Which fill, and if asked how many lights, is
decided by the error that they are predicted to make (prediction.py). With the memory of the last
frame, key lights are looked for where they were, cuts stay while they are nearly as good, and a
light stays where it is while its centroid moves less than a small part of its width.

Domain : world frame; blocks of a lat-long grid (summed_area.py, block_grid.py).
Cost   : with 64 lights 1.3 ms a frame beside the block sums; about 7 ms for the first one, which
         tries every fill; later ones try another now and then. For an error, which many more probes
         measure, 80 ms for the first frame.
Fails  : sources that are neither narrow nor alone in their cell are one wide light; a cell's light
         slides between two of them as they change (tests/limits/test_adaptive_dim_lamps.py).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lighting.adaptive import prediction
from lighting.adaptive.cell_tree import EMPTY_TREE, CellTree
from lighting.adaptive.filled_cells import FilledCells, FilledMap, fill_and_cut
from lighting.adaptive.key_lights import take_key_lights
from lighting.adaptive.smooth_fill import FillShape
from lighting.blocks.block_grid import BlockGrid, block_grid, coarsened
from lighting.blocks.summed_area import block_sums
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics

Array = NDArray[np.float64]

SHAPES = tuple(FillShape(order, weight) for weight in (1000.0, 100.0, 10.0) for order in (0, 1, 2))
"""The first ones are too bright the least: of fills alike behind occluders, truer in the open."""
MOST_LIGHTS_FOR_ERROR = 512
"""Where no fewer meet the asked error."""
SAFETY = 1.2
"""An error is met when it is predicted to be this many times smaller. In steps of 0.1 the first
that is no less than the 95 % quantile of real over predicted errors, which is 1.18, on 18 captured
scenes at 2, 5 and 10 %. On nine others, held out, 26 in 27 cases are met; with 1.1 only 22."""
_GROWTH = 2.0
"""From frame to frame, the number of lights for an error grows at most so many times, and by 8."""
_BETTER = 0.85
"""Another fill is taken when its error, or count of lights, is at most this part of today's."""
_ALIKE = 1.1
"""Of fills that err at most this many times as much as the best, the first is taken. With 64 lights
that leaves 0.267 instead of 0.298 % in the open (median of 34 captured maps), with 256 lights 0.068
instead of 0.102 %, and as much behind occluders."""
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
    shape : FillShape
    turn : int
        Frames so far: which other fill is tried next.
    key_directions : (k, 3) float64
    tree : CellTree
        Cells of the lights that were returned.
    directions : (n, 3) float64
        Where the light of each cell of the tree stands, or would.
    """

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


def adaptive(environment: EnvironmentMap, count: int) -> Reduced:
    """Return at most `count` lights, and a fill, for a map by itself.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, key lights included, at least 1. Fewer are returned if lights and fill
        hold all the light with fewer: none for a map of one colour.
    """
    rows = block_rows(count, None)
    blocks = block_sums(environment.radiance, rows)
    return adaptive_next(blocks, block_grid(environment.height, rows), count)[0]


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
    rows = _cell_rows(count, error)
    least_share = error / 2 if error else max(0.005, 1 / (3 * count))
    fine = coarsened(blocks, block_rows(count, error))
    grid = grid.coarser(block_rows(count, error))
    keys = take_key_lights(
        fine,
        grid,
        least_share,
        count // 2,
        memory.key_directions if memory else np.empty((0, 3)),
    )
    probes = prediction.PROBES_TO_MEASURE if error else prediction.PROBES_TO_COMPARE
    as_keys = prediction.responses(keys.directions, keys.angular_radius_rad, probes)
    from_keys = as_keys.T @ keys.irradiance
    grid = grid.coarser(rows)
    rest = coarsened(keys.rest, rows)
    received = prediction.map_responses(rest, grid, probes)
    scale = float(np.sqrt(np.mean((received + from_keys) ** 2)))
    whole = rest.sum(axis=0).sum(axis=0)[4:]  # in this order ten times as fast
    filled = FilledMap(rest, grid, received, scale, whole)
    cells = count - len(keys.directions)
    if error and memory:
        cells = min(cells, int(_GROWTH * len(memory.tree.leaves())) + 8)
    candidates = [
        fill_and_cut(
            filled,
            shape,
            cells,
            memory.tree if memory and memory.shape == shape else EMPTY_TREE,
            is_every_number=error is not None,
        )
        for shape in _shapes_to_try(memory)
    ]
    chosen, number, predicted = _choose(candidates, error, memory)

    tree = chosen.tree.prefix(number)
    kept = tree.leaves()
    directions = _held(chosen, memory)[: len(tree.cuts)]
    irradiance = chosen.irradiance[kept]
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
        np.concatenate([keys.angular_radius_rad, chosen.angular_radius_rad[kept]]),
        len(keys.directions),
        chosen.fill * np.maximum(dimming, 0.0),
        predicted,
        grid.rows,
    )
    turn = memory.turn + 1 if memory else 0
    return reduced, Memory(chosen.shape, turn, keys.directions, tree, directions)


def block_rows(count: int, error: float | None) -> int:
    """Return the most rows of blocks that `adaptive_next` makes use of."""
    return max(_cell_rows(count, error), _KEY_ROWS)


def _cell_rows(count: int, error: float | None) -> int:
    return 64 if count <= 64 or error else 128 if count <= 256 else 256


def _shapes_to_try(memory: Memory | None) -> tuple[FillShape, ...]:
    """Return the fills to compare: at first all, then today's and now and then another."""
    if memory is None:
        return SHAPES
    turn, is_next = divmod(memory.turn, _FRAMES_PER_TRY)
    other = SHAPES[turn % len(SHAPES)]
    return (memory.shape, other) if not is_next and other != memory.shape else (memory.shape,)


def _choose(
    candidates: list[FilledCells], error: float | None, memory: Memory | None
) -> tuple[FilledCells, int, float]:
    """Return what to take, its number of lights and its error; the first candidate is today's."""
    if error is None:
        at = [0] * len(candidates)
        costs = [float(cells.errors[0]) for cells in candidates]
    else:
        at = [_fewest(cells.errors, error / SAFETY, memory) for cells in candidates]
        costs = [
            # Of as many lights, the fill of the lower order; of too few, that which errs least.
            n + cells.shape.order / 4
            if cells.errors[n] * SAFETY <= error
            else len(cells.errors) * cells.errors[n] * SAFETY / error
            for cells, n in zip(candidates, at, strict=True)
        ]
    most = min(costs) * (_ALIKE if error is None else 1.0)
    best = next(i for i, cost in enumerate(costs) if cost <= most)
    if memory is not None and costs[best] > _BETTER * costs[0]:
        best = 0
    cells = candidates[best]
    return cells, int(cells.numbers[at[best]]), float(cells.errors[at[best]])


def _fewest(errors: Array, error: float, memory: Memory | None) -> int:
    """Return the fewest lights that meet an error; as many as before while not far fewer would."""
    met = np.flatnonzero(errors <= error)
    fewest = int(met[0]) if len(met) else len(errors) - 1
    if memory is not None:
        before = len(memory.tree.leaves())
        if before < len(errors) and errors[before] <= error and fewest > _FEWER * before:
            return before
    return fewest


def _held(cells: FilledCells, memory: Memory | None) -> Array:
    """Return where the light of each cell stands: its centroid, but for the backlash."""
    directions = cells.directions
    if memory is None or memory.shape != cells.shape:
        return directions
    held = directions.copy()
    stays = cells.was >= 0
    before = memory.directions[cells.was[stays]]
    chord = directions[stays] - before
    distance = np.linalg.norm(chord, axis=1)
    slack = _BACKLASH * cells.angular_radius_rad[stays]
    part = np.where(distance > slack, 1 - slack / np.maximum(distance, 1e-300), 0.0)
    moved = before + part[:, None] * chord
    held[stays] = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    # Not moved at all, to the bit, where it need not.
    held[np.flatnonzero(stays)[part == 0]] = before[part == 0]
    return held
