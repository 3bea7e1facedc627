"""From an environment map to the lights that stand for it, by any method.

A method is a function of an environment map and a count that returns directions (K, 3), irradiance
(K, 3) and angular radii (K,); tests/lighting/test_method_contract.py states what each keeps to.
Methods that need no more of a map than its block sums also take those, wherever they come from.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.blocks.block_grid import BlockGrid, block_grid
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.summed_area import MOST_ROWS, block_sums
from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap, luminance
from lighting.methods.adaptive import (
    Memory,
    Reduced,
    adaptive,
    adaptive_next,
    adaptive_of_blocks,
    block_rows,
)
from lighting.methods.cells import cells, cells_of_blocks
from lighting.methods.hierarchical import hierarchical
from lighting.methods.inverse_cdf import inverse_cdf
from lighting.methods.kollig_keller import (
    kollig_keller,
    kollig_keller_of_blocks,
    lloyd,
    lloyd_of_blocks,
)
from lighting.methods.median_cut import median_cut, median_cut_of_blocks
from lighting.methods.penrose import penrose
from lighting.methods.q2_tree import q2_tree, q2_tree_of_blocks
from lighting.methods.stratified import stratified_random
from lighting.methods.structured import structured
from lighting.methods.variance_minimisation import (
    variance_minimisation,
    variance_minimisation_of_blocks,
)
from lighting.sphere.latlong import solid_angles

Array = NDArray[np.float64]
Lights = tuple[Array, Array, Array]
"""Directions (K, 3), irradiance (K, 3) and angular radii (K,)."""
Method = Callable[[EnvironmentMap, int], Lights | Reduced]
BlockMethod = Callable[[Array, int], Lights | Reduced]

ADAPTIVE = "adaptive"

METHODS: Mapping[str, Method] = {
    "inverse-cdf": inverse_cdf,
    "stratified-random": stratified_random,
    "hierarchical": hierarchical,
    "median-cut": median_cut,
    "variance-minimisation": variance_minimisation,
    "structured": structured,
    "lloyd": lloyd,
    "kollig-keller": kollig_keller,
    "penrose": penrose,
    "q2-tree": q2_tree,
    "cells": cells,
    ADAPTIVE: adaptive,
}

BLOCK_METHODS: Mapping[str, BlockMethod] = {
    "median-cut": median_cut_of_blocks,
    "variance-minimisation": variance_minimisation_of_blocks,
    "lloyd": lloyd_of_blocks,
    "kollig-keller": kollig_keller_of_blocks,
    "q2-tree": q2_tree_of_blocks,
    "cells": cells_of_blocks,
    ADAPTIVE: adaptive_of_blocks,
}
"""Those of `METHODS` that take block sums (rows, columns, 7) too."""

MOST_LIGHTS = 65536
"""More lights than any renderer here draws; a larger number is a slip of the keyboard."""


def most_block_rows(count: int, method: str = ADAPTIVE, error: float | None = None) -> int:
    """Return the most rows of blocks that a reduction makes use of."""
    return block_rows(count, error) if method == ADAPTIVE else MOST_ROWS


def check_request(count: int, method: str, error: float | None) -> None:
    """Raise InputError unless there is such a method, and it can be asked for that."""
    if method not in METHODS:
        raise InputError(f"no method is called {method!r}; there are: {', '.join(METHODS)}")
    if not 1 <= count <= MOST_LIGHTS:
        raise InputError(f"the number of lights must be 1 to {MOST_LIGHTS}, got {count}")
    if error is not None and not 0 < error < 1:
        raise InputError(f"the error to be met must be between 0 and 1, got {error:g}")
    if error is not None and method != ADAPTIVE:
        raise InputError(f"only the {ADAPTIVE} method can be asked for an error, not {method!r}")


def reduce_to_lights(
    view: EnvironmentMap | BlockSums,
    count: int,
    method: str = ADAPTIVE,
    *,
    error: float | None = None,
    timestamp_s: float = 0.0,
    source: str = "",
) -> LightSet:
    """Return `count` distant lights that, with their fill, hold all the light of a view.

    Parameters
    ----------
    view : EnvironmentMap or BlockSums
        A map, or sums over blocks wherever they come from.
    count : int
        Number of lights, 1 to 65536. This many are returned, fewer if the method needs fewer to
        hold all the light, none for a view without light.
    method : str
        A key of `METHODS`; for block sums, of `BLOCK_METHODS`.
    error : float or None
        With the adaptive method: as few lights as are predicted to err by no more than this behind
        occluders, relatively, and at most `count`.
    timestamp_s : float
        Moment of the view.
    source : str
        What the view was made from, for people.

    Raises
    ------
    InputError
        If the count or the error is out of range, or the method is unknown or cannot be asked for
        an error.
    """
    lights, _ = reduce_next(
        view, count, method, error=error, timestamp_s=timestamp_s, source=source
    )
    return lights


def reduce_next(
    view: EnvironmentMap | BlockSums,
    count: int,
    method: str = ADAPTIVE,
    memory: Memory | None = None,
    *,
    error: float | None = None,
    timestamp_s: float = 0.0,
    source: str = "",
) -> tuple[LightSet, Memory | None]:
    """Return the lights of the next frame of a sequence, and what to remember of it.

    What `reduce_to_lights` does, with the memory that the frame before left, of a view of the same
    size. Only the adaptive method has one.

    Raises
    ------
    InputError
        As `reduce_to_lights`.
    """
    check_request(count, method, error)
    is_map = isinstance(view, EnvironmentMap)
    if not is_map and method not in BLOCK_METHODS:
        raise InputError(
            f"no method for block sums is called {method!r}; there are: {', '.join(BLOCK_METHODS)}"
        )

    if method == ADAPTIVE:
        blocks, grid = _blocks_of(view, block_rows(count, error))
        reduced, memory = adaptive_next(blocks, grid, count, error=error, memory=memory)
    elif isinstance(view, BlockSums):
        reduced = Reduced(*BLOCK_METHODS[method](view.sums, count))
    else:
        reduced = Reduced(*METHODS[method](view, count))
    key_count = reduced.key_count
    made = f"{len(reduced.directions)} lights by {method}"
    if key_count:
        made += f", {key_count} of them key lights"
    lights = LightSet(
        reduced.directions,
        reduced.irradiance,
        reduced.angular_radius_rad,
        timestamp_s=timestamp_s,
        clipped_fraction=_clipped_fraction(view),
        scale=view.scale,
        source=f"{source}: {made}" if source else made,
        is_key=np.arange(len(reduced.directions)) < key_count,
        fill=reduced.fill,
        predicted_error=reduced.predicted_error,
        block_rows=reduced.block_rows,
    )
    return lights, memory


def _blocks_of(view: EnvironmentMap | BlockSums, most_rows: int) -> tuple[Array, BlockGrid]:
    if isinstance(view, BlockSums):
        return view.sums, block_grid(view.rows)
    return block_sums(view.radiance, most_rows), block_grid(view.height, most_rows)


def _clipped_fraction(view: EnvironmentMap | BlockSums) -> float:
    """Return the share of the luminance that comes from clipped cells or pixels."""
    if isinstance(view, BlockSums):
        return view.clipped_fraction
    cells = np.flatnonzero(view.clipped)
    rows = cells // view.clipped.shape[1]
    light = luminance(view.radiance.reshape(-1, 3)[cells])
    clipped = float(light @ solid_angles(view.height)[rows])
    return min(clipped / float(view.integral() @ LUMINANCE_WEIGHTS), 1.0) if clipped else 0.0
