"""Grids of blocks: made coarser, and what each block covers.

Domain : world frame, blocks of a lat-long grid (summed_area.py).
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.summed_area import MOST_ROWS, block_sums
from lighting.sphere import harmonics

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BlockGrid:
    """What the blocks of a grid cover.

    Attributes
    ----------
    area : (rows, columns, 4) float64
        ∫dω and ∫d dω of each block.
    """

    area: Array

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.area)

    @cached_property
    def directions(self) -> Array:
        """Unit mean direction of each block, (rows, columns, 3)."""
        moment = self.area[..., 1:]
        return moment / np.linalg.norm(moment, axis=-1, keepdims=True)

    @cached_property
    def functions(self) -> Array:
        """Harmonics toward each block's mean direction, (rows, columns, 9)."""
        return harmonics.basis(self.directions)

    @lru_cache(maxsize=8)  # noqa: B019 - grids are few, and live as long as the program
    def coarser(self, most_rows: int) -> "BlockGrid":
        """Return the grid that `coarsened` makes of this one's blocks."""
        return BlockGrid(coarsened(self.area, most_rows))


@lru_cache(maxsize=8)
def block_grid(map_height: int, most_rows: int = MOST_ROWS) -> BlockGrid:
    """Return the grid of the blocks that `summed_area.block_sums` makes of an N × 2N map."""
    even = np.ones((map_height, 2 * map_height, 3), np.float32)
    return BlockGrid(np.ascontiguousarray(block_sums(even, most_rows)[..., :4]))


def coarsened(blocks: Array, most_rows: int) -> Array:
    """Return sums over larger blocks, a whole number of the given ones a side, `most_rows` at most.

    Parameters
    ----------
    blocks : (rows, columns, channels) float64
    most_rows : int
        At least 1.
    """
    factor = -(-len(blocks) // most_rows)
    if factor == 1:
        return blocks
    rows, columns, channels = blocks.shape
    sums = np.zeros((-(-rows // factor), -(-columns // factor), channels))
    _add_up(blocks, factor, sums)
    return sums


@njit(cache=True, nogil=True)
def _add_up(blocks, factor, sums):  # type: ignore[no-untyped-def]
    rows, columns, channels = blocks.shape
    for r in range(rows):
        line = sums[r // factor]
        for wide in range(len(line)):
            for c in range(wide * factor, min((wide + 1) * factor, columns)):
                for k in range(channels):
                    line[wide, k] += blocks[r, c, k]
