"""From a camera picture to an environment map, without losing or inventing light.

Input  : a RadianceImage and the Calibration of its camera.    Output : an EnvironmentMap.
Every pixel's flux (radiance × solid angle) is shared among the cells it covers (footprint.py), and
a cell's radiance is the mean of what it got, weighted by solid angle. So a constant picture stays
constant, and a light smaller than a pixel keeps its flux and its place at any size of map.
`build_remap` does this once for a camera and a size of map; `apply_remap` is then one sparse
product per picture. A single picture of any size goes through `remap_image.remap_image`.
Cost   : see tests/benchmarks/remap.py.
Fails  : at the edge of what the camera sees. A cell there holds the mean of the part that was seen,
so a light in it counts for the whole cell.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from calibration.camera import Calibration
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.maps.environment import EnvironmentMap
from lighting.maps.footprint import count_entries, fill_entries, row_balance
from lighting.maps.pixel_grid import (
    pixel_corners,
    pixel_illumination,
    pixel_reflected,
    strip_order,
)
from lighting.sphere.latlong import solid_angles

_FULL = 0.8
"""Share of a cell that pixels must cover for it to be taken as covered whole: below it the cell
lies on the edge of the picture, above it the difference to 1 is the unevenness of sampling."""
_BALANCE_ROUNDS = 8
HALF = 0.5
"""Coverage from which on a cell is valid."""
_TASKS = 64
"""Parts the map is cut into for threads, of equal work."""


@dataclass(frozen=True)
class Remap:
    """A camera's way onto a lat-long grid: a sparse matrix from pixels to cells.

    Attributes
    ----------
    height : int
        N of the N × 2N map.
    image_size_px : (int, int)
        (width, height) of the pictures it takes.
    cells : (C,) int64
        Flat indices of the cells that pixels cover, in the order they are best visited.
    starts : (C + 1,) int64
        Entries starts[i] … starts[i + 1] belong to cells[i].
    pixels : (E,) uint32
        Flat pixel index of each entry.
    weights : (E,) float32
        Weight of the pixel in the cell's mean; divided by the lens's relative illumination.
    coverage : (N, 2N) float32
        Share of each cell's solid angle that the camera sees, 0 to 1.
    illumination : (H W,) float32
        Relative illumination of each pixel; empty if it is 1 everywhere.
    reflected : (H W, 3) float32
        What a mirror ball reflects to each pixel, by which its radiance is divided; or empty.
    """

    height: int
    image_size_px: tuple[int, int]
    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    pixels: NDArray[np.uint32]
    weights: NDArray[np.float32]
    coverage: NDArray[np.float32]
    illumination: NDArray[np.float32]
    reflected: NDArray[np.float32]


def build_remap(calibration: Calibration, height: int) -> Remap:
    """Return the operator from a camera's pictures to maps of `height` × 2 `height` cells.

    It holds about four entries of 8 bytes per pixel where cells are larger than pixels, and about
    four per cell where they are smaller. The entries are balanced (Sinkhorn's iteration), so that
    every pixel gives its whole solid angle and every covered cell gets its own; the imbalance that
    is left is the error of a small light's flux.
    """
    factors = row_balance(height)
    corners, seen = pixel_corners(calibration, 0, calibration.image_size_px[1])
    counts = count_entries(corners, seen, factors)
    starts = np.zeros(counts.shape[1] + 1, np.int64)
    np.cumsum(counts.sum(axis=0), out=starts[1:])
    places = starts[:-1] + np.cumsum(counts, axis=0) - counts
    pixels, masses, pixel_sr = fill_entries(corners, seen, factors, places, int(starts[-1]))
    cell_sr = np.repeat(solid_angles(height), 2 * height)
    weights, coverage = _balance(starts, pixels, masses, pixel_sr, cell_sr)
    illumination = pixel_illumination(calibration, 0, calibration.image_size_px[1])
    if illumination.size:
        weights /= illumination[pixels]
    cells, ordered_starts, order = _visits(starts, pixels, calibration.image_size_px[0])
    return Remap(
        height=height,
        image_size_px=calibration.image_size_px,
        cells=cells,
        starts=ordered_starts,
        pixels=pixels[order],
        weights=weights[order],
        coverage=coverage.reshape(height, 2 * height),
        illumination=illumination,
        reflected=pixel_reflected(calibration, 0, calibration.image_size_px[1]),
    )


def apply_remap(remap: Remap, image: RadianceImage) -> EnvironmentMap:
    """Return the environment map that a picture shows.

    Pixels that are not valid count for nothing. A cell is valid if valid pixels cover half of it,
    clipped if any clipped pixel contributed to it, and black if it is not valid.

    Raises
    ------
    InputError
        If the picture's size is not the one the operator was built for.
    """
    if image.size_px != remap.image_size_px:
        raise InputError(
            f"the picture is {image.size_px[0]}×{image.size_px[1]} px but the remap was built for "
            f"{remap.image_size_px[0]}×{remap.image_size_px[1]}"
        )
    shape = (remap.height, 2 * remap.height)
    pixels = image.radiance.reshape(-1, 3)
    if remap.reflected.size:
        pixels = pixels / remap.reflected
    tasks = np.searchsorted(remap.starts, np.linspace(0, remap.starts[-1], _TASKS + 1)[1:-1])
    tasks = np.concatenate([[0], tasks, [remap.starts.size - 1]])
    # numpy asks for huge pages, numba does not, and its fresh pages take as long as some products.
    radiance = np.zeros((remap.coverage.size, 3), np.float32)
    clipped = np.zeros(remap.coverage.size, np.bool_)
    if image.valid.all() and not image.clipped.any():
        valid = remap.coverage.ravel() >= HALF
        _fill_cells(
            tasks, remap.cells, remap.starts, remap.pixels, remap.weights, valid,
            pixels.reshape(-1), radiance,
        )  # fmt: skip
    else:
        valid = np.zeros(remap.coverage.size, np.bool_)
        _fill_marked_cells(
            tasks,
            remap.cells,
            remap.starts,
            remap.pixels,
            remap.weights,
            remap.coverage.ravel(),
            remap.illumination,
            pixels,
            image.valid.ravel(),
            image.clipped.ravel(),
            radiance,
            valid,
            clipped,
        )
    return EnvironmentMap(
        radiance.reshape(*shape, 3), valid.reshape(shape), clipped.reshape(shape), image.scale
    )


@njit(cache=True, nogil=True, parallel=True)
def _balance(starts, pixels, masses, pixel_sr, cell_sr):  # type: ignore[no-untyped-def]
    """Return the weights of the entries in their cell's mean, and the coverage of the cells.

    Pixels and cells are scaled in turns until each pixel's entries sum to its solid angle and each
    covered cell's to its own. A cell on the edge of the picture keeps the sum that it has.
    """
    cell_count = len(cell_sr)
    target = np.empty(cell_count)
    coverage = np.empty(cell_count, np.float32)
    cell_scale = np.empty(cell_count)
    pixel_scale = np.ones(len(pixel_sr))
    for i in prange(cell_count):
        total = 0.0
        for k in range(starts[i], starts[i + 1]):
            total += masses[k]
        target[i] = cell_sr[i] if total > _FULL * cell_sr[i] else total
        coverage[i] = target[i] / cell_sr[i]
    for _ in range(_BALANCE_ROUNDS):
        for i in prange(cell_count):
            total = 0.0
            for k in range(starts[i], starts[i + 1]):
                total += masses[k] * pixel_scale[pixels[k]]
            cell_scale[i] = target[i] / total if total > 0.0 else 0.0
        given = np.zeros(len(pixel_sr))
        for i in range(cell_count):
            for k in range(starts[i], starts[i + 1]):
                given[pixels[k]] += masses[k] * cell_scale[i]
        for p in prange(len(pixel_sr)):
            if given[p] > 0.0:
                pixel_scale[p] = pixel_sr[p] / given[p]
    weights = np.empty(len(masses), np.float32)
    for i in prange(cell_count):
        total = 0.0
        for k in range(starts[i], starts[i + 1]):
            total += masses[k] * pixel_scale[pixels[k]]
        for k in range(starts[i], starts[i + 1]):
            weights[k] = masses[k] * pixel_scale[pixels[k]] / total if total > 0.0 else 0.0
    return weights, coverage


def _visits(
    starts: NDArray[np.int64], pixels: NDArray[np.uint32], width_px: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the cells (C,) that have entries, in strips of the picture, and the order for entries.

    With the cells come the starts (C + 1,) of their entries once those are in the order (E,).
    """
    counts = np.diff(starts)
    cells = np.flatnonzero(counts)
    cells = cells[strip_order(pixels[starts[cells]], width_px)]
    ordered_starts = np.concatenate([[0], np.cumsum(counts[cells])])
    shift = np.repeat(starts[cells] - ordered_starts[:-1], counts[cells])
    return cells, ordered_starts, shift + np.arange(starts[-1])


@njit(cache=True, nogil=True, parallel=True, fastmath={"contract"}, error_model="numpy")
def _fill_cells(tasks, cells, starts, pixels, weights, wanted, radiance, result):  # type: ignore[no-untyped-def]
    """Fill the radiance (2N², 3) of the wanted cells from that of the pixels (3 H W,).

    Indices are unsigned: others are first looked at for whether they count from the end, which
    takes a quarter of the time.
    """
    one, two, three = np.uintp(1), np.uintp(2), np.uintp(3)
    for task in prange(len(tasks) - 1):
        k = np.uintp(starts[tasks[task]])
        for i in range(tasks[task], tasks[task + 1]):
            cell, last = cells[i], np.uintp(starts[i + 1])
            red = green = blue = 0.0
            while k < last:
                at, weight = three * np.uintp(pixels[k]), np.float64(weights[k])
                red += weight * radiance[at]
                green += weight * radiance[at + one]
                blue += weight * radiance[at + two]
                k += one
            if wanted[cell]:
                result[cell, 0] = red
                result[cell, 1] = green
                result[cell, 2] = blue


@njit(cache=True, nogil=True, parallel=True)
def _fill_marked_cells(  # type: ignore[no-untyped-def]
    tasks,
    cells,
    starts,
    pixels,
    weights,
    coverage,
    illumination,
    radiance,
    pixel_valid,
    pixel_clipped,
    result,
    valid,
    clipped,
):
    """Fill the radiance (2N², 3) from valid pixels, and mark the cells that are valid, clipped."""
    for task in prange(len(tasks) - 1):
        for i in range(tasks[task], tasks[task + 1]):
            cell = cells[i]
            red = green = blue = share = 0.0
            is_clipped = False
            for k in range(starts[i], starts[i + 1]):
                p = pixels[k]
                if pixel_valid[p]:
                    weight = np.float64(weights[k])
                    red += weight * radiance[p, 0]
                    green += weight * radiance[p, 1]
                    blue += weight * radiance[p, 2]
                    share += weight * illumination[p] if len(illumination) else weight
                    is_clipped |= pixel_clipped[p]
            clipped[cell] = is_clipped
            if share * coverage[cell] >= HALF:
                valid[cell] = True
                result[cell, 0] = red / share
                result[cell, 1] = green / share
                result[cell, 2] = blue / share
