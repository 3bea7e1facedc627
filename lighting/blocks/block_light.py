"""Luminous power of blocks of cells, and the colour of few of them: all that samplers need.

Domain : the blocks of a lat-long grid that summed_area.py makes.    Input : radiance.
Output : power of each block and the map's integral; colour of chosen blocks.
Cost   : one pass over the map, half of what `summed_area.block_sums` takes; the rest is per block.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.summed_area import cells_per_block
from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere.latlong import solid_angles

Array = NDArray[np.float64]


def block_light(radiance: NDArray[np.float32]) -> tuple[Array, Array]:
    """Return ∫Y dω of each block, (rows, columns), and ∫L dω of the map, (3,), of (N, 2N, 3)."""
    height, width, _ = radiance.shape
    side = cells_per_block(height)
    light = np.zeros((-(-height // side), -(-width // side)))
    return light, _add_cells(radiance, side, solid_angles(height), light)


def block_colours(radiance: NDArray[np.float32], blocks: NDArray[np.int64]) -> Array:
    """Return ∫L dω (n, 3) of blocks (n,), given by their flat indices."""
    height = len(radiance)
    return _colours(radiance, cells_per_block(height), solid_angles(height), blocks)


@njit(cache=True, nogil=True)
def _add_cells(radiance, side, solid_angle, light):  # type: ignore[no-untyped-def]
    """Add each cell to the light of its block; return the sums (3,) of all."""
    red_weight, green_weight, blue_weight = LUMINANCE_WEIGHTS
    height, width, _ = radiance.shape
    whole = width // side
    integral = np.zeros(3)
    for row in range(height):
        line = light[row // side]
        red = green = blue = 0.0
        for block in range(len(line)):
            # A number of cells that no comparison decides: half as long again otherwise.
            cells = side if block < whole else width - whole * side
            r = g = b = 0.0
            for column in range(block * side, block * side + cells):
                r += radiance[row, column, 0]
                g += radiance[row, column, 1]
                b += radiance[row, column, 2]
            line[block] += (red_weight * r + green_weight * g + blue_weight * b) * solid_angle[row]
            red += r
            green += g
            blue += b
        integral[0] += red * solid_angle[row]
        integral[1] += green * solid_angle[row]
        integral[2] += blue * solid_angle[row]
    return integral


@njit(cache=True, nogil=True)
def _colours(radiance, side, solid_angle, blocks):  # type: ignore[no-untyped-def]
    height, width, _ = radiance.shape
    columns = -(-width // side)
    colours = np.zeros((len(blocks), 3))
    for i in range(len(blocks)):
        top, left = blocks[i] // columns * side, blocks[i] % columns * side
        for row in range(top, min(top + side, height)):
            for column in range(left, min(left + side, width)):
                for channel in range(3):
                    colours[i, channel] += radiance[row, column, channel] * solid_angle[row]
    return colours
