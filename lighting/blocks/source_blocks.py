"""From a camera picture straight to block sums, without an environment map in between.

Input  : a RadianceImage and the Calibration of its camera.    Output : BlockSums.
Each pixel adds its light with its own solid angle and first moment (pixel_moments.py) to the block
that its middle lies in. Neither the energy nor the direction of light is rounded to a grid: blocks
only say where cells can be cut. No pixel is ever cut, so a sun of one pixel is one light.
`build_source_blocks` does this once for a camera; `apply_source_blocks` is then one pass over the
picture. `picture_blocks` is for single pictures of any size, in bounded memory.
Cost   : see tests/benchmarks/source.py; 20 bytes a pixel for as long as the camera is used.
Fails  : the light of a block over its solid angle is no radiance: where pixels are not much smaller
than blocks, some have one more than others (tests/limits/test_source_uneven_blocks.py). A pixel is
seen if its centre is, so on the edge of the picture light comes and goes by whole pixels
(tests/limits/test_source_edge.py).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from calibration.camera import Calibration
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.blocks.block_entries import Entries, block_entries
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.summed_area import MOST_ROWS
from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere.latlong import grid_to_direction, solid_angles

_COVERAGE_SAMPLES = 4
"""Points on the side of a block that tell which part of it is seen."""
_BAND_PX = 1_000_000
_TASKS = 64
"""Parts the blocks are cut into for threads, of equal work."""


@dataclass(frozen=True, eq=False)
class SourceBlocks:
    """A camera's way onto the blocks of a lat-long grid.

    Attributes
    ----------
    image_size_px : (int, int)
        (width, height) of the pictures it takes.
    entries : Entries
    unseen_sr : (rows, 2 rows) float64
        Solid angle of what the camera does not see of each block.
    """

    image_size_px: tuple[int, int]
    entries: Entries
    unseen_sr: NDArray[np.float64]


def build_source_blocks(calibration: Calibration, rows: int = MOST_ROWS) -> SourceBlocks:
    """Return the operator from a camera's pictures to sums over `rows` × 2 `rows` blocks."""
    size_px = calibration.image_size_px
    entries = block_entries(calibration, rows, 0, size_px[1])
    return SourceBlocks(size_px, entries, _unseen_sr(calibration, rows))


def apply_source_blocks(
    source: SourceBlocks, image: RadianceImage, *, is_beside: bool = False
) -> BlockSums:
    """Return the light that a picture shows, over blocks.

    Pixels that are not valid are unseen. The same picture gives the same bits on any number of
    threads.

    Parameters
    ----------
    source : SourceBlocks
    image : RadianceImage
    is_beside : bool
        Sum on the calling thread alone, beside the one that owns all parallel kernels.

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
    light = _Light(len(source.unseen_sr), is_beside=is_beside)
    light.add(source.entries, image.radiance, image.valid, image.clipped)
    return light.block_sums(source.unseen_sr, image.scale)


def picture_blocks(
    calibration: Calibration, image: RadianceImage, rows: int = MOST_ROWS
) -> BlockSums:
    """Return the light that one picture shows, over blocks, a band of pixels at a time.

    Raises
    ------
    InputError
        If the picture's size is not the calibration's, or it has no valid pixel that is seen.
    """
    calibration.check_size(image.size_px, "the picture")
    width, height = image.size_px
    light = _Light(rows)
    is_any_valid = False
    band_rows = max(_BAND_PX // width, 1)
    for first in range(0, height, band_rows):
        band = slice(first, min(first + band_rows, height))
        entries = block_entries(calibration, rows, band.start, band.stop)
        light.add(entries, image.radiance[band], image.valid[band], image.clipped[band])
        is_any_valid |= bool(image.valid[band].ravel()[entries.pixels].any())
    if not is_any_valid:
        raise InputError(
            "no valid pixel of the picture lies in what the calibration says the camera sees; "
            "check that they belong together"
        )
    return light.block_sums(_unseen_sr(calibration, rows), image.scale)


class _Light:
    """Sums over blocks that pixels are added to."""

    def __init__(self, rows: int, *, is_beside: bool = False) -> None:
        self._is_beside = is_beside
        # numpy asks for huge pages, numba does not, and its fresh pages take longer than the sums.
        self.sums = np.zeros((rows, 2 * rows, 7))
        self.missing_sr = np.zeros((rows, 2 * rows))
        self.clipped = np.zeros((rows, 2 * rows))

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
        if entries.reflected.size:
            pixel_radiance = pixel_radiance / entries.reflected
        add_light = _add_light_alone if self._is_beside else _add_light
        add_light(
            tasks,
            entries.blocks,
            entries.centres,
            entries.starts,
            entries.pixels,
            entries.weights,
            pixel_radiance,
            self.sums.reshape(-1, 7),
        )
        is_marked = clipped | ~valid
        if is_marked.any():
            add_marks = _add_marks_alone if self._is_beside else _add_marks
            add_marks(
                tasks,
                entries.blocks,
                entries.starts,
                entries.pixels,
                entries.weights,
                entries.illumination,
                pixel_radiance,
                is_marked.ravel(),
                valid.ravel(),
                clipped.ravel(),
                self.missing_sr.ravel(),
                self.clipped.ravel(),
            )

    def block_sums(self, unseen_sr: NDArray[np.float64], scale: str) -> BlockSums:
        return BlockSums(self.sums, unseen_sr + self.missing_sr, self.clipped, scale)


def _unseen_sr(calibration: Calibration, rows: int) -> NDArray[np.float64]:
    """Return the solid angle of what the camera does not see of each block, (rows, 2 rows).

    It is told by points spread over the block, and by the camera and not its pixels: next to a pole
    a pixel lies on many blocks.
    """
    side = _COVERAGE_SAMPLES
    at = (np.arange(2 * rows * side) + 0.5) / side - 0.5
    shares = np.empty((rows, 2 * rows))
    for row in range(rows):
        grid = np.stack(np.meshgrid(at, at[row * side : (row + 1) * side]), axis=-1)
        _, seen = calibration.project(grid_to_direction(grid, rows))
        shares[row] = 1.0 - seen.reshape(side, 2 * rows, side).mean(axis=(0, 2))
    return shares * solid_angles(rows)[:, None]


@njit(cache=True, nogil=True, parallel=True)
def _add_light(  # type: ignore[no-untyped-def]
    tasks, blocks, centres, starts, pixels, weights, radiance, sums
):
    """Add the light of pixels (h W, 3) to the sums (2 rows², 7) of blocks."""
    for task in prange(len(tasks) - 1):
        _add_light_of(
            tasks[task], tasks[task + 1], blocks, centres, starts, pixels, weights, radiance, sums
        )


@njit(cache=True, nogil=True)
def _add_light_alone(  # type: ignore[no-untyped-def]
    tasks, blocks, centres, starts, pixels, weights, radiance, sums
):
    """Do what `_add_light` does on the thread that calls."""
    _add_light_of(0, tasks[-1], blocks, centres, starts, pixels, weights, radiance, sums)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_light_of(  # type: ignore[no-untyped-def]
    first, last, blocks, centres, starts, pixels, weights, radiance, sums
):
    red_weight, green_weight, blue_weight = LUMINANCE_WEIGHTS
    for i in range(first, last):
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
        centre_x, centre_y, centre_z = centres[i]
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
    tasks, blocks, starts, pixels, weights, illumination, radiance, is_marked, valid, clipped,
    missing_sr, light,
):  # fmt: skip
    """Add the solid angle of pixels that are not valid, and the luminance of clipped ones."""
    for task in prange(len(tasks) - 1):
        _add_marks_of(
            tasks[task], tasks[task + 1], blocks, starts, pixels, weights, illumination, radiance,
            is_marked, valid, clipped, missing_sr, light,
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _add_marks_alone(  # type: ignore[no-untyped-def]
    tasks, blocks, starts, pixels, weights, illumination, radiance, is_marked, valid, clipped,
    missing_sr, light,
):  # fmt: skip
    """Do what `_add_marks` does on the thread that calls."""
    _add_marks_of(
        0, tasks[-1], blocks, starts, pixels, weights, illumination, radiance, is_marked, valid,
        clipped, missing_sr, light,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _add_marks_of(  # type: ignore[no-untyped-def]
    first, last, blocks, starts, pixels, weights, illumination, radiance, is_marked, valid,
    clipped, missing_sr, light,
):  # fmt: skip
    red_weight, green_weight, blue_weight = LUMINANCE_WEIGHTS
    for i in range(first, last):
        for k in range(starts[i], starts[i + 1]):
            p = pixels[k]
            if not is_marked[p]:
                continue
            if not valid[p]:
                share = illumination[p] if len(illumination) else 1.0
                missing_sr[blocks[i]] += weights[k, 0] * share
            if clipped[p]:
                light[blocks[i]] += np.float64(weights[k, 0]) * (
                    red_weight * np.float64(radiance[p, 0])
                    + green_weight * np.float64(radiance[p, 1])
                    + blue_weight * np.float64(radiance[p, 2])
                )
