"""Where a camera's pixels look: the directions of their corners, and how much light reaches them.

Domain : world frame; rows [first_row, last_row) of the picture, so that a large one can be taken in
bands.
Input  : the Calibration of the camera.    Output : plain arrays.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration

_RIM_HALVINGS = 12
"""Of the way from a corner without a direction to the nearest that has one."""
_STRIP_ROWS = 16
"""Rows of a strip of the picture, see `strip_order`."""


def pixel_corners(
    calibration: Calibration, first_row: int, last_row: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return directions (h + 1, W + 1, 3) of the corners of rows, and which pixels are seen (h, W).

    A pixel is seen if its centre is. Where the lens model ends between the centre and a corner (the
    outline of a mirror ball, whose last pixels span many degrees), the corner is pulled inward.
    """
    width = calibration.image_size_px[0]
    corner_px = _pixels(width + 1, first_row, last_row + 1) - 0.5
    centre_px = _pixels(width, first_row, last_row)
    corners, _ = calibration.unproject(corner_px)
    _, seen = calibration.unproject(centre_px)
    unknown = ~np.isfinite(corners).all(axis=-1)
    if unknown.any():
        counts = _sum_at_corners(seen[..., None].astype(np.float64))
        unknown &= counts[..., 0] > 0
        inside = (_sum_at_corners(centre_px * seen[..., None])[unknown]) / counts[unknown]
        outside = corner_px[unknown]
        for _ in range(_RIM_HALVINGS):
            middle = (inside + outside) / 2
            known = np.isfinite(calibration.unproject(middle)[0]).all(axis=-1, keepdims=True)
            inside, outside = np.where(known, middle, inside), np.where(known, outside, middle)
        corners[unknown] = calibration.unproject(inside)[0]
    return corners, np.asarray(seen)


def pixel_illumination(
    calibration: Calibration, first_row: int, last_row: int
) -> NDArray[np.float32]:
    """Return the relative illumination of rows of pixels, (h W,); empty without vignetting."""
    if not any((*calibration.vignetting, *calibration.uneven_vignetting)):
        return np.empty(0, np.float32)
    pixels = _pixels(calibration.image_size_px[0], first_row, last_row)
    directions, seen = calibration.unproject(pixels)
    illumination = calibration.illumination(directions)
    return np.where(seen, illumination, 1.0).astype(np.float32).ravel()


def pixel_reflected(calibration: Calibration, first_row: int, last_row: int) -> NDArray[np.float32]:
    """Return the share of each channel that a mirror ball reflects to rows of pixels, (h W, 3).

    Empty for lenses, and for balls whose reflectance is not known.
    """
    if not calibration.reflectance:
        return np.empty((0, 3), np.float32)
    directions, seen = calibration.unproject(
        _pixels(calibration.image_size_px[0], first_row, last_row)
    )
    reflected = np.ones((*seen.shape, 3), np.float32)
    reflected[seen] = calibration.reflected_share(directions[seen])
    return reflected.reshape(-1, 3)


def strip_order(first_pixels: NDArray[np.integer[Any]], width_px: int) -> NDArray[np.int64]:
    """Return in which order cells are best visited, given a pixel of each (n,) by flat index.

    In strips of the picture, from left to right: their pixels then come from few lines of memory at
    a time. In the order of the sphere it takes twice as long.
    """
    row, column = np.divmod(first_pixels.astype(np.int64), width_px)
    return np.lexsort((row, column, row // _STRIP_ROWS))


def _sum_at_corners(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of pixel values (h, W, k) around each corner, (h + 1, W + 1, k)."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    return padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]


def _pixels(width: int, first_row: int, last_row: int) -> NDArray[np.float64]:
    """Return the coordinates (x, y) of picture rows, (h, width, 2)."""
    grid = np.meshgrid(np.arange(width), np.arange(first_row, last_row))
    return np.stack(grid, axis=-1).astype(np.float64)
