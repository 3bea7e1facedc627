"""Grids of blocks: nothing is lost when they are made coarser."""

import numpy as np
import pytest

from lighting.blocks.block_grid import block_grid, coarsened
from lighting.blocks.summed_area import block_sums
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import outdoors

HEIGHTS = pytest.mark.parametrize("height", [16, 50, 64, 300])


@HEIGHTS
@pytest.mark.parametrize("most_rows", [7, 16, 128])
def test_coarser_blocks_hold_what_theirs_do(height, most_rows):
    blocks = block_sums(outdoors(height).radiance)
    coarse = coarsened(blocks, most_rows)
    assert len(coarse) <= most_rows
    side = -(-len(blocks) // most_rows)
    for r, c in [(0, 0), (1, 2), (len(coarse) - 1, coarse.shape[1] - 1)]:
        own = blocks[r * side : (r + 1) * side, c * side : (c + 1) * side]
        np.testing.assert_allclose(coarse[r, c], own.sum(axis=(0, 1)), rtol=1e-12)
    np.testing.assert_allclose(coarse.sum(axis=(0, 1)), blocks.sum(axis=(0, 1)), rtol=1e-10)


@HEIGHTS
def test_blocks_cover_the_sphere_evenly(height):
    whole = block_grid(height).area.sum(axis=(0, 1))
    np.testing.assert_allclose(whole, [4 * np.pi, 0, 0, 0], atol=1e-9)


def test_a_coarser_grid_is_that_of_the_coarser_blocks():
    # Of 300 rows in blocks of 2, then of 4; and straight in blocks of 4.
    grid = block_grid(300).coarser(75)
    np.testing.assert_allclose(grid.area, block_grid(300, 75).area, atol=1e-12)
    assert block_grid(300).coarser(75) is grid  # made once


def test_a_block_of_one_cell_is_that_cell():
    grid = block_grid(32)
    np.testing.assert_allclose(grid.area[..., 0], np.tile(solid_angles(32)[:, None], 64))
    inner = slice(1, -1)  # at the poles, the mean of a cell's directions is not its middle
    cosine = (grid.directions * cell_directions(32))[inner].sum(axis=-1)
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 0.35
