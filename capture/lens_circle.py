"""The circle that a fisheye draws on a larger sensor: it stands still though the camera moves.

Input  : linear pictures of one bracket.    Output : which pixels lie outside of the circle.
Fails  : where the scene itself is dark all along the rim, no circle is found; a black frame of
         another shape is taken for scene.
"""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

_DARK = 0.02
"""Linear value below which a pixel may lie outside."""

_LEAST_OVERLAP = 0.97
"""Shared part (intersection over union) of what is not dark and the disc fitted to it."""


def outside_circle(pictures: Iterable[NDArray[np.float32]]) -> NDArray[np.bool_] | None:
    """Return the pixels outside of the lens's circle, or None where no picture shows one.

    Parameters
    ----------
    pictures : iterable of (H, W, 3) float32
        Linear values, the brightest picture first: the first that shows a circle is believed.
    """
    return next((mask for mask in map(_outside, pictures) if mask is not None), None)


def _outside(linear: NDArray[np.float32]) -> NDArray[np.bool_] | None:
    is_dark = (linear[..., 0] < _DARK) & (linear[..., 1] < _DARK) & (linear[..., 2] < _DARK)
    if not is_dark[[0, 0, -1, -1], [0, -1, 0, -1]].all():
        return None
    dark = cv2.medianBlur(is_dark.astype(np.uint8), 5)
    _, label = cv2.connectedComponents(dark)
    corners = label[[0, 0, -1, -1], [0, -1, 0, -1]]
    if 0 in corners:  # the label of what is not dark
        return None
    inside = ~np.isin(label, corners)
    # Where the picture ends and not the circle, erosion takes nothing off.
    rim = inside & (cv2.erode(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)
    y_px, x_px = np.nonzero(rim)
    if len(x_px) < 3:
        return None
    # x² + y² = 2 x x₀ + 2 y y₀ + (r² − x₀² − y₀²), linear in the three unknowns.
    columns = np.stack([2.0 * x_px, 2.0 * y_px, np.ones(len(x_px))], axis=1)
    x0, y0, rest = np.linalg.lstsq(columns, x_px**2.0 + y_px**2.0, rcond=None)[0]
    rows, across = np.ogrid[: inside.shape[0], : inside.shape[1]]
    disc = (across - x0) ** 2 + (rows - y0) ** 2 <= rest + x0**2 + y0**2
    overlap = np.count_nonzero(disc & inside) / np.count_nonzero(disc | inside)
    return ~disc if overlap > _LEAST_OVERLAP else None
