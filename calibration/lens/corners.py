"""The corners of all views in one array each, which is what the solver works on.

Domain : views in order, the corners of one view side by side; points in metres, board frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.observations import View

_WARP_TERMS = [(total - j, j) for total in (2, 3, 4) for j in range(total + 1)]

WARP_DEGREES = np.array([i + j for i, j in _WARP_TERMS])
"""Degree of each of the shapes that a board's warp is made of."""


@dataclass(frozen=True, eq=False)
class Corners:
    """What was seen of a board in V views, N corners in all.

    Attributes
    ----------
    points_m : (N, 3) float64
        On the board.
    pixels : (N, 2) float64
    sigma_px : (N,) float64
        Of either coordinate; only the ratios between corners are believed.
    starts : (V + 1,) int64
        Corners starts[v] to starts[v + 1] − 1 are those of view v.
    ids : (N,) int64
        Which point of the board.
    warp_shapes : (N, 12) float64
        How far each of `WARP_DEGREES` lifts the corner along the board's +z: products of Legendre's
        polynomials of x and y, which run from −1 to 1 over the board. Planes are left out.
    """

    points_m: NDArray[np.float64]
    pixels: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    starts: NDArray[np.int64]
    ids: NDArray[np.int64]
    warp_shapes: NDArray[np.float64]

    @property
    def view_count(self) -> int:
        """V."""
        return len(self.starts) - 1

    @property
    def view_of(self) -> NDArray[np.int64]:
        """View (N,) of each corner."""
        return np.repeat(np.arange(self.view_count), np.diff(self.starts))

    def of_view(self, view: int) -> slice:
        """Return the place of a view's corners in the arrays."""
        return slice(int(self.starts[view]), int(self.starts[view + 1]))

    def where(self, kept: NDArray[np.bool_]) -> "Corners":
        """Return the corners that are kept (N,); views stay, even if empty."""
        counts = np.bincount(self.view_of[kept], minlength=self.view_count)
        return self._taken(np.flatnonzero(kept), counts)

    def views(self, chosen: NDArray[np.int64]) -> "Corners":
        """Return the corners of the chosen views alone, in the order chosen."""
        places = [np.arange(self.starts[view], self.starts[view + 1]) for view in chosen]
        at = np.concatenate([np.empty(0, np.int64), *places])
        return self._taken(at, np.array([len(place) for place in places], np.int64))

    def with_pixels(self, pixels: NDArray[np.float64]) -> "Corners":
        """Return the corners found elsewhere (N, 2)."""
        return replace(self, pixels=pixels)

    def spacing_px(self) -> float:
        """Return how far apart corners of neighbouring numbers are, by the median."""
        step = np.hypot(*np.diff(self.pixels, axis=0).T)
        return float(np.median(step[np.diff(self.ids) == 1]))

    def _taken(self, at: NDArray[np.int64], counts: NDArray[np.int64]) -> "Corners":
        return Corners(
            self.points_m[at],
            self.pixels[at],
            self.sigma_px[at],
            np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            self.ids[at],
            self.warp_shapes[at],
        )


def gather(board: Board, views: Sequence[View]) -> Corners:
    """Return the corners of all views."""
    ids = np.concatenate([view.point_ids for view in views])
    points_m = board.points_m()
    low, high = points_m.min(axis=0)[:2], points_m.max(axis=0)[:2]
    along, down = (2.0 * (points_m[:, :2] - low) / (high - low) - 1.0).T
    products = np.polynomial.legendre.legvander2d(along, down, [4, 4]).reshape(-1, 5, 5)
    shapes = np.stack([products[:, i, j] for i, j in _WARP_TERMS], axis=-1)
    return Corners(
        points_m[ids],
        np.concatenate([view.corners_px for view in views]),
        np.concatenate([view.corner_sigma_px for view in views]),
        np.concatenate([[0], np.cumsum([len(view) for view in views])]).astype(np.int64),
        ids,
        shapes[ids],
    )
