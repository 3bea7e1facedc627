"""From a camera picture straight to block sums, without an environment map in between.

Input  : a RadianceImage and the Calibration of its camera.    Output : BlockSums.
Each pixel is weighted by its own exact solid angle and first moment (pixel_pieces.py). Neither the
energy of a light nor its direction is rounded to a grid; blocks only say where cells can be cut.
`build_source_blocks` does this once for a camera; `apply_source_blocks` is then one pass over the
picture. `picture_blocks` is for single pictures of any size, in bounded memory.
Cost   : see tests/benchmarks/source_blocks.py; 20 bytes a pixel for as long as the camera is used.
Fails  : a pixel is seen if its centre is, so along the edge of what the camera sees light comes and
goes by whole pixels; of a picture with fewer pixels than blocks, each pixel's light is spread
evenly over it (tests/limits/test_source_coarse_pixels.py).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from calibration.camera import Calibration
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.blocks import BlockSums
from lighting.environment import LUMINANCE_WEIGHTS
from lighting.latlong import grid_to_direction, solid_angles
from lighting.pixel_grid import pixel_corners, pixel_illumination
from lighting.pixel_pieces import axis_factors, block_centre, pixel_pieces

BLOCK_ROWS = 256
"""As many as summed_area.py makes of a large map."""

_STRIP_ROWS = 16
"""Blocks are visited in strips of the picture this high, from left to right: their pixels then come
from few lines of memory at a time. In the order of the sphere it takes more than twice as long."""
_COVERAGE_SAMPLES = 4
"""Points on the side of a block that tell which part of it is seen."""
_BAND_PX = 1_000_000
_TASKS = 64
"""Parts the blocks are cut into for threads, of equal work."""


class Entries(NamedTuple):
    """Which pixels each block takes, with what weight.

    Attributes
    ----------
    blocks : (V,) int32
        Flat indices of the blocks that pixels lie in, in the order they are visited.
    starts : (V + 1,) int64
        Entries starts[i] … starts[i + 1] belong to blocks[i].
    pixels : (E,) uint32
        Flat pixel index of each entry, rising within a block.
    weights : (E, 4) float32
        ∫dω of the part of the pixel in the block, and ∫(d − d_b) dω (3) about the direction d_b of
        the block's centre; divided by the lens's relative illumination.
    illumination : (H W,) float32
        Relative illumination of each pixel; empty if it is 1 everywhere.
    """

    blocks: NDArray[np.int32]
    starts: NDArray[np.int64]
    pixels: NDArray[np.uint32]
    weights: NDArray[np.float32]
    illumination: NDArray[np.float32]


@dataclass(frozen=True)
class SourceBlocks:
    """A camera's way onto the blocks of a lat-long grid.

    Attributes
    ----------
    image_size_px : (int, int)
        (width, height) of the pictures it takes.
    entries : Entries
    seen : (rows, 2 rows) float64
        Share of each block's solid angle that the camera sees, 0 to 1.
    """

    image_size_px: tuple[int, int]
    entries: Entries
    seen: NDArray[np.float64]


def build_source_blocks(calibration: Calibration, rows: int = BLOCK_ROWS) -> SourceBlocks:
    """Return the operator from a camera's pictures to sums over `rows` × 2 `rows` blocks."""
    size_px = calibration.image_size_px
    entries = _entries(calibration, rows, 0, size_px[1])
    return SourceBlocks(size_px, entries, _seen_shares(calibration, rows))


def apply_source_blocks(source: SourceBlocks, image: RadianceImage) -> BlockSums:
    """Return the light that a picture shows, over blocks.

    Pixels that are not valid are unseen: their light is missing, and so is their share in `seen`.
    The same picture gives the same bits on any number of threads.

    Raises
    ------
    InputError
        If the picture's size is not the one the operator was built for.
    """
    if image.size_px != source.image_size_px:
        raise InputError(
            f"the picture is {image.size_px[0]}×{image.size_px[1]} px but the blocks were built "
            f"for {source.image_size_px[0]}×{source.image_size_px[1]}"
        )
    light = _Light(*source.seen.shape)
    light.add(source.entries, image.radiance, image.valid, image.clipped)
    return light.block_sums(source.seen, image.scale)


def picture_blocks(
    calibration: Calibration, image: RadianceImage, rows: int = BLOCK_ROWS
) -> BlockSums:
    """Return the light that one picture shows, over blocks, a band of pixels at a time.

    Raises
    ------
    InputError
        If the picture's size is not the calibration's, or it has no valid pixel that is seen.
    """
    calibration.check_size(image.size_px, "the picture")
    width, height = image.size_px
    light = _Light(rows, 2 * rows)
    is_any_valid = False
    band_rows = max(_BAND_PX // width, 1)
    for first in range(0, height, band_rows):
        band = slice(first, min(first + band_rows, height))
        entries = _entries(calibration, rows, band.start, band.stop)
        light.add(entries, image.radiance[band], image.valid[band], image.clipped[band])
        is_any_valid |= bool(image.valid[band].ravel()[entries.pixels].any())
    if not is_any_valid:
        raise InputError(
            "no valid pixel of the picture lies in what the calibration says the camera sees; "
            "check that they belong together"
        )
    return light.block_sums(_seen_shares(calibration, rows), image.scale)


class _Light:
    """Sums over blocks that pixels are added to."""

    def __init__(self, rows: int, columns: int) -> None:
        # numpy asks for huge pages, numba does not, and its fresh pages take longer than the sums.
        self.sums = np.zeros((rows, columns, 7))
        self.missing_sr = np.zeros((rows, columns))
        self.clipped = np.zeros((rows, columns))

    def add(
        self,
        entries: Entries,
        radiance: NDArray[np.float32],
        valid: NDArray[np.bool_],
        clipped: NDArray[np.bool_],
    ) -> None:
        """Add pixels (h, W, 3) with their marks (h, W)."""
        cuts = np.linspace(0, entries.starts[-1], _TASKS + 1)
        tasks = np.searchsorted(entries.starts, cuts)
        pixel_radiance = radiance.reshape(-1, 3)
        _add_light(
            tasks,
            *entries[:4],
            pixel_radiance,
            *axis_factors(len(self.sums)),
            self.sums.reshape(-1, 7),
        )
        if clipped.any() or not valid.all():
            _add_marks(
                tasks,
                *entries,
                pixel_radiance,
                valid.ravel(),
                clipped.ravel(),
                self.missing_sr.ravel(),
                self.clipped.ravel(),
            )

    def block_sums(self, seen: NDArray[np.float64], scale: str) -> BlockSums:
        if self.missing_sr.any():
            seen = np.maximum(seen - self.missing_sr / solid_angles(len(seen))[:, None], 0.0)
        return BlockSums(self.sums, seen, self.clipped, scale)


def _entries(calibration: Calibration, rows: int, first_row: int, last_row: int) -> Entries:
    """Return the entries of rows [first_row, last_row) of the picture."""
    corners, seen = pixel_corners(calibration, first_row, last_row)
    piece_blocks, pixels, weights = pixel_pieces(corners, seen, rows)
    blocks, firsts, block_of, counts = np.unique(
        piece_blocks, return_index=True, return_inverse=True, return_counts=True
    )
    row, column = np.divmod(pixels[firsts], seen.shape[1])
    visits = np.lexsort((row, column, row // _STRIP_ROWS))
    rank = np.empty(len(visits), np.int64)
    rank[visits] = np.arange(len(visits))
    order = np.argsort(rank[block_of], kind="stable")
    pixels, weights = pixels[order], weights[order]
    illumination = pixel_illumination(calibration, first_row, last_row)
    if illumination.size:
        weights /= illumination[pixels, None]
    starts = np.concatenate([[0], np.cumsum(counts[visits])])
    return Entries(blocks[visits], starts, pixels, weights, illumination)


def _seen_shares(calibration: Calibration, rows: int) -> NDArray[np.float64]:
    """Return the share of each block that the camera sees, (rows, 2 rows)."""
    side = _COVERAGE_SAMPLES
    at = (np.arange(2 * rows * side) + 0.5) / side - 0.5
    shares = np.empty((rows, 2 * rows))
    for row in range(rows):
        grid = np.stack(np.meshgrid(at, at[row * side : (row + 1) * side]), axis=-1)
        _, seen = calibration.project(grid_to_direction(grid, rows))
        shares[row] = seen.reshape(side, 2 * rows, side).mean(axis=(0, 2))
    return shares


@njit(cache=True, nogil=True, parallel=True, fastmath={"contract"})
def _add_light(  # type: ignore[no-untyped-def]
    tasks, blocks, starts, pixels, weights, radiance, row_factors, column_factors, sums
):
    """Add the light of pixels (h W, 3) to the sums (2 rows², 7) of blocks."""
    red_weight, green_weight, blue_weight = LUMINANCE_WEIGHTS
    for task in prange(len(tasks) - 1):
        for i in range(tasks[task], tasks[task + 1]):
            red = green = blue = x = y = z = 0.0
            for k in range(starts[i], starts[i + 1]):
                p = pixels[k]
                # float64 before any product: single pixels may be as bright as float32 goes.
                r = np.float64(radiance[p, 0])
                g = np.float64(radiance[p, 1])
                b = np.float64(radiance[p, 2])
                luminance = red_weight * r + green_weight * g + blue_weight * b
                solid_angle = np.float64(weights[k, 0])
                red += solid_angle * r
                green += solid_angle * g
                blue += solid_angle * b
                x += luminance * np.float64(weights[k, 1])
                y += luminance * np.float64(weights[k, 2])
                z += luminance * np.float64(weights[k, 3])
            power = red_weight * red + green_weight * green + blue_weight * blue
            centre_x, centre_y, centre_z = block_centre(blocks[i], row_factors, column_factors)
            line = sums[blocks[i]]
            line[0] += power
            line[1] += power * centre_x + x
            line[2] += power * centre_y + y
            line[3] += power * centre_z + z
            line[4] += red
            line[5] += green
            line[6] += blue


@njit(cache=True, nogil=True, parallel=True)
def _add_marks(  # type: ignore[no-untyped-def]
    tasks,
    blocks,
    starts,
    pixels,
    weights,
    illumination,
    radiance,
    valid,
    clipped,
    missing_sr,
    light,
):
    """Add the solid angle of pixels that are not valid, and the luminance of clipped ones."""
    red_weight, green_weight, blue_weight = LUMINANCE_WEIGHTS
    for task in prange(len(tasks) - 1):
        for i in range(tasks[task], tasks[task + 1]):
            for k in range(starts[i], starts[i + 1]):
                p = pixels[k]
                if not valid[p]:
                    share = illumination[p] if len(illumination) else 1.0
                    missing_sr[blocks[i]] += weights[k, 0] * share
                if clipped[p]:
                    light[blocks[i]] += np.float64(weights[k, 0]) * (
                        red_weight * np.float64(radiance[p, 0])
                        + green_weight * np.float64(radiance[p, 1])
                        + blue_weight * np.float64(radiance[p, 2])
                    )
