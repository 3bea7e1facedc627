"""A board found in a picture: which of its points are where.

Input  : grey counts, (H, W) uint8, and the board.    Output : View, or Rejected with the reason.
The points' order is always the one of a board seen from its printed side. A checkerboard that half
a turn takes to itself has two such orders that mean the same; the one is taken whose first row lies
farther up and left in the picture.
Fails  : squares less than three pixels wide. A picture that was mirrored looks like one of another
board; only a lens fitted to all views can tell.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.detection_grid import CornerGrid, find_grids
from calibration.detection_markers import find_marked_points
from calibration.detection_refine import refine_corners
from calibration.observations import Rejected, View

Array = NDArray[np.float64]

_SCALES = (1.0, 0.5, 0.25, 0.125, 2.0)
"""Sizes a checkerboard is looked for in, in turn, until it is found whole.

Where light spills over the edges of dark squares their corners no longer touch, and where a picture
is blurred or noisy they cannot be seen; made smaller, it shows them as they should be.
"""

_LARGEST_PX = 4000
_SMALLEST_PX = 200
"""Longer sides of the pictures that are looked at."""

_WHOLE_LINE = 0.5
"""Share of corners that an outer line of a checkerboard needs; less is a stray edge's."""

_LEAST_FOUND = 0.6
"""Share of a checkerboard's corners without which its place in the grid is not sure."""

_LEAST_POINTS = 8

_WINDOW = 0.7
"""Radius of a corner's window over the distance to the next edge: room for that one's blur."""


def detect_board(grey: NDArray[np.uint8], board: Board, name: str) -> View | Rejected:
    """Return the board's points in a picture (H, W), or why there is none to be used.

    Of a ChArUco board or a grid of tags any part will do; a checkerboard must show all four sides,
    because its corners look alike.
    """
    if board.pattern == "checkerboard":
        found = _checkerboard(grey, board, name)
        if isinstance(found, Rejected):
            return found
        return _refined(grey, found, _WINDOW, name)
    lattice = find_marked_points(grey, board)
    if not np.any(np.isfinite(lattice)):
        return Rejected(name, f"no marker of the {board.pattern} board was read")
    # A marker begins (1 − ratio)/2 of a square away from both edges of a ChArUco corner.
    charuco = board.pattern == "charuco"
    window = _WINDOW * (1 - board.marker_ratio) / np.sqrt(2) if charuco else _WINDOW
    return _refined(grey, lattice, window, name)


def _checkerboard(grey: NDArray[np.uint8], board: Board, name: str) -> Array | Rejected:
    """Return the corners (rows, columns, 2), NaN where one was not found."""
    wanted = board.grid
    best: Array | None = None
    other: tuple[int, int] | None = None
    most_others = 0
    for scale in _SCALES:
        longest = scale * max(grey.shape)
        if not _SMALLEST_PX <= longest <= _LARGEST_PX:
            continue
        for grid in find_grids(_scaled(grey, scale)):
            lattice, dark_first = _trimmed(grid)
            lattice = (lattice + 0.5) / scale - 0.5
            count = _count(lattice)
            rows, columns = lattice.shape[:2]
            if sorted((columns, rows)) != sorted(wanted):
                if count > most_others:
                    other, most_others = (columns, rows), count
            elif best is None or count > _count(best):
                best = _oriented(lattice, dark_first, wanted)
        if best is not None and _count(best) == best.size // 2:
            return best
    columns, rows = wanted
    if best is not None:
        if _count(best) >= _LEAST_FOUND * columns * rows:
            return best
        return Rejected(name, f"only {_count(best)} of {columns * rows} corners can be seen")
    if other is None:
        return Rejected(name, "no checkerboard was found")
    seen = (max(other), min(other)) if columns >= rows else (min(other), max(other))
    return Rejected(
        name,
        f"{seen[0]}×{seen[1]} inner corners were found, wanted {columns}×{rows}: "
        "all of the board must be seen, and --board counts inner corners",
        seen_grid=seen,
    )


def _scaled(grey: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    if scale == 1.0:
        return grey
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    height, width = (max(1, round(scale * side)) for side in grey.shape)
    return np.asarray(cv2.resize(grey, (width, height), interpolation=way), np.uint8)


def _count(lattice: Array) -> int:
    return int(np.isfinite(lattice[..., 0]).sum())


def _trimmed(grid: CornerGrid) -> tuple[Array, bool]:
    """Return the grid's corners (rows, columns, 2) without outer lines that are mostly empty.

    And whether the square beyond the first one is dark.
    """
    columns, rows = grid.size
    lattice = np.full((rows, columns, 2), np.nan)
    lattice[grid.places[:, 1], grid.places[:, 0]] = grid.corners_px
    dark_first = grid.dark_first
    while min(lattice.shape[:2]) > 2:
        found = np.isfinite(lattice[..., 0])
        fill = [found[0].mean(), found[:, 0].mean(), found[-1].mean(), found[:, -1].mean()]
        side = int(np.argmin(fill))
        if fill[side] >= _WHOLE_LINE:
            break
        lattice = np.delete(lattice, 0 if side < 2 else -1, axis=side % 2)
        dark_first ^= side < 2
    return lattice, dark_first


def _oriented(lattice: Array, dark_first: bool, wanted: tuple[int, int]) -> Array:
    """Return the corners turned to the wanted columns and rows, a dark square beyond the first."""
    rows, columns = lattice.shape[:2]
    turns = []
    for quarter in range(4):
        turned = np.rot90(lattice, quarter)
        dark = dark_first ^ bool(columns % 2 and quarter in (1, 2))
        dark ^= bool(rows % 2 and quarter in (2, 3))
        if turned.shape[:2] == (wanted[1], wanted[0]):
            turns.append((not dark, float(np.nanmean(turned[0])), quarter, turned))
    return min(turns, key=lambda turn: turn[:3])[3]


def _refined(grey: NDArray[np.uint8], lattice: Array, window: float, name: str) -> View | Rejected:
    """Return the view of points near (rows, columns, 2), those left out that are no corners."""
    height, width = grey.shape
    flat = lattice.reshape(-1, 2)
    reach = window * _distance_to_next_edge(lattice).ravel()
    in_picture = np.all((flat >= 0) & (flat <= [width - 1, height - 1]), axis=-1)
    ids = np.flatnonzero(in_picture & np.isfinite(reach))
    if len(ids) == 0:
        return Rejected(name, "no two neighbouring points were found")
    corners, sigma, found = refine_corners(grey, flat[ids], reach[ids])
    if found.sum() < _LEAST_POINTS:
        return Rejected(name, f"only {found.sum()} points are sharp enough to be measured")
    return View(name, (width, height), ids[found], corners[found], sigma[found])


def _distance_to_next_edge(lattice: Array) -> Array:
    """Return how far from each point (rows, columns) its neighbours' crossing edges are, in px.

    That is the least height of the parallelograms that a point forms with two neighbours.
    """
    rows, columns = lattice.shape[:2]
    padded = np.full((rows + 2, columns + 2, 2), np.nan)
    padded[1:-1, 1:-1] = lattice
    across = [padded[1:-1, shift : shift + columns] - lattice for shift in (0, 2)]
    down = [padded[shift : shift + rows, 1:-1] - lattice for shift in (0, 2)]
    least = np.full((rows, columns), np.inf)
    for a in across:
        for b in down:
            area = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
            longest = np.maximum(np.hypot(*np.moveaxis(a, -1, 0)), np.hypot(*np.moveaxis(b, -1, 0)))
            least = np.fmin(least, area / longest)
    return np.where(np.isfinite(least), least, np.nan)
