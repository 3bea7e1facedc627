"""From an environment map to the lights that stand for it, by any method.

A method is a function of an environment map and a count that returns directions (K, 3), irradiance
(K, 3) and angular radii (K,); tests/lighting/test_method_contract.py states what each keeps to.
Methods that need no more of a map than its block sums also take those, wherever they come from.
"""

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.blocks import BlockSums
from lighting.environment import LUMINANCE_WEIGHTS, EnvironmentMap, luminance
from lighting.latlong import solid_angles
from lighting.light_set import LightSet
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

Array = NDArray[np.float64]
Lights = tuple[Array, Array, Array]
"""Directions (K, 3), irradiance (K, 3) and angular radii (K,)."""
Method = Callable[[EnvironmentMap, int], Lights]
BlockMethod = Callable[[Array, int], Lights]

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
}

BLOCK_METHODS: Mapping[str, BlockMethod] = {
    "median-cut": median_cut_of_blocks,
    "variance-minimisation": variance_minimisation_of_blocks,
    "lloyd": lloyd_of_blocks,
    "kollig-keller": kollig_keller_of_blocks,
    "q2-tree": q2_tree_of_blocks,
    "cells": cells_of_blocks,
}
"""Those of `METHODS` that take block sums (rows, columns, 7) too."""

MOST_LIGHTS = 65536
"""More lights than any renderer here draws; a larger number is a slip of the keyboard."""


def reduce_to_lights(
    environment: EnvironmentMap,
    count: int,
    method: str = "inverse-cdf",
    *,
    timestamp_s: float = 0.0,
    source: str = "",
) -> LightSet:
    """Return `count` distant lights whose irradiances sum to the map's integral.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, 1 to 65536. This many are returned, fewer if the method needs fewer to
        hold all the light, none for a map without light.
    method : str
        A key of `METHODS`.
    timestamp_s : float
        Moment of the map.
    source : str
        What the map was made from, for people.

    Raises
    ------
    InputError
        If the count is out of range or the method unknown.
    """
    _check(count, method, METHODS, "method")
    directions, irradiance, angular_radius_rad = METHODS[method](environment, count)
    made = f"{len(directions)} lights by {method}"
    return LightSet(
        directions,
        irradiance,
        angular_radius_rad,
        timestamp_s=timestamp_s,
        clipped_fraction=_clipped_fraction(environment, irradiance.sum(axis=0)),
        scale=environment.scale,
        source=f"{source}: {made}" if source else made,
    )


def reduce_blocks_to_lights(
    blocks: BlockSums,
    count: int,
    method: str = "cells",
    *,
    timestamp_s: float = 0.0,
    source: str = "",
) -> LightSet:
    """Return `count` distant lights whose irradiances sum to the integral over all blocks.

    What `reduce_to_lights` does, for a key of `BLOCK_METHODS` and without a map.

    Raises
    ------
    InputError
        If the count is out of range or the method is not one that takes blocks.
    """
    _check(count, method, BLOCK_METHODS, "method for block sums")
    directions, irradiance, angular_radius_rad = BLOCK_METHODS[method](blocks.sums, count)
    made = f"{len(directions)} lights by {method}"
    return LightSet(
        directions,
        irradiance,
        angular_radius_rad,
        timestamp_s=timestamp_s,
        clipped_fraction=blocks.clipped_fraction,
        scale=blocks.scale,
        source=f"{source}: {made}" if source else made,
    )


def _check(count: int, method: str, methods: Iterable[str], kind: str) -> None:
    if not 1 <= count <= MOST_LIGHTS:
        raise InputError(f"the number of lights must be 1 to {MOST_LIGHTS}, got {count}")
    if method not in methods:
        raise InputError(f"no {kind} is called {method!r}; there are: {', '.join(methods)}")


def _clipped_fraction(environment: EnvironmentMap, integral: Array) -> float:
    """Return the share of the luminance of `integral` (3,) that lies in clipped cells."""
    cells = np.flatnonzero(environment.clipped)
    rows = cells // environment.clipped.shape[1]
    light = luminance(environment.radiance.reshape(-1, 3)[cells])
    clipped = float(light @ solid_angles(environment.height)[rows])
    return min(clipped / float(integral @ LUMINANCE_WEIGHTS), 1.0) if clipped else 0.0
