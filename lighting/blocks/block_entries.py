"""Which block of a lat-long grid each pixel of a camera adds its light to, with what weight.

Domain : rows [first_row, last_row) of the picture, so that a large one can be taken in bands.
Input  : the Calibration of the camera.    Output : Entries, in the order they are best visited.
A pixel belongs to the block that its middle lies in, whole; its weights are its own solid angle and
first moment (pixel_moments.py).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from lighting.maps.pixel_grid import (
    pixel_corners,
    pixel_illumination,
    pixel_reflected,
    strip_order,
)
from lighting.maps.pixel_moments import pixel_moments
from lighting.sphere.latlong import cell_directions, direction_to_grid


class Entries(NamedTuple):
    """Which pixels each block takes, with what weight.

    Attributes
    ----------
    blocks : (B,) int64
        Flat indices of the blocks that pixels lie in, in the order they are visited.
    centres : (B, 3) float64
        Directions of their centres.
    starts : (B + 1,) int64
        Entries starts[i] … starts[i + 1] belong to blocks[i].
    pixels : (P,) uint32
        Flat index of the pixel of each entry; every seen pixel has one.
    weights : (P, 4) float32
        ∫dω of the pixel, and ∫(d − d_b) dω (3) about the direction d_b of its block's centre, both
        divided by the lens's relative illumination. These moments are small, so that single
        precision is enough.
    illumination : (H W,) float32
        Relative illumination of each pixel; empty if it is 1 everywhere.
    reflected : (H W, 3) float32
        What a mirror ball reflects to each pixel, by which its radiance is divided; or empty.
    """

    blocks: NDArray[np.int64]
    centres: NDArray[np.float64]
    starts: NDArray[np.int64]
    pixels: NDArray[np.uint32]
    weights: NDArray[np.float32]
    illumination: NDArray[np.float32]
    reflected: NDArray[np.float32]


def block_entries(calibration: Calibration, rows: int, first_row: int, last_row: int) -> Entries:
    """Return the entries of pictures' rows for `rows` × 2 `rows` blocks."""
    corners, seen = pixel_corners(calibration, first_row, last_row)
    solid_angle, moment = pixel_moments(corners, seen)
    column, row = np.rint(direction_to_grid(moment, rows)).astype(np.int64).T
    block = np.minimum(row, rows - 1) * 2 * rows + column
    centres = cell_directions(rows).reshape(-1, 3)
    moment -= solid_angle[:, None] * centres[block]
    weights = np.column_stack([solid_angle, moment])

    pixels = np.flatnonzero(seen)
    illumination = pixel_illumination(calibration, first_row, last_row)
    if illumination.size:
        weights /= illumination[pixels, None]
    blocks, firsts, place, counts = np.unique(
        block, return_index=True, return_inverse=True, return_counts=True
    )
    visits = strip_order(pixels[firsts], seen.shape[1])
    rank = np.empty(len(visits), np.int64)
    rank[visits] = np.arange(len(visits))
    order = np.argsort(rank[place], kind="stable")
    return Entries(
        blocks=blocks[visits],
        centres=centres[blocks[visits]],
        starts=np.concatenate([[0], np.cumsum(counts[visits])]),
        pixels=pixels[order].astype(np.uint32),
        weights=weights[order].astype(np.float32),
        illumination=illumination,
        reflected=pixel_reflected(calibration, first_row, last_row),
    )
