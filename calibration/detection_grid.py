"""A checkerboard's corners found one by one and joined along the edges between them.

Input  : grey counts, (H, W).    Output : grids of corners, each a place in the grid and a pixel.
A corner is a saddle of brightness with four edges around it. Two are neighbours if an edge of each
points at the other with the same side dark. Nothing is assumed of a lens, so that boards bent
strongly, at the rim of a fisheye or in a mirror, are found as well as flat ones.
Cost   : 20 to 100 ms a megapixel, the more the more cluttered.
Fails  : squares less than five pixels wide; corners whose edges are blurred over half a square.
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MOST_SADDLES = 4000
_MOST_CORNERS = 1000
"""More come from texture; the strongest are kept, for the search goes with the square of them."""

_LEAST_CORNERS = 9
"""What makes a grid."""

_RING = 48
"""Samples on the circle around a saddle."""

_RING_RADIUS_PX = 3.5

_LEAST_CONTRAST = 12.0
"""Counts between the dark and the light quarters on the circle."""

_BEND = np.deg2rad(25.0)
"""Largest angle between an edge at its corner and the straight line to the next one."""


@dataclass(frozen=True, eq=False)
class CornerGrid:
    """Corners that hang together, with their places counted from the least row and column.

    Attributes
    ----------
    places : (n, 2) int64
        Column and row; columns run along +x and rows along +y of some rotation of the picture.
    corners_px : (n, 2) float64
    dark_first : bool
        Whether the square beyond the place (0, 0), up and to the left of it, is a dark one.
    """

    places: NDArray[np.int64]
    corners_px: Array
    dark_first: bool

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        columns, rows = self.places.max(axis=0) + 1
        return int(columns), int(rows)


def find_grids(grey: NDArray[np.uint8]) -> list[CornerGrid]:
    """Return the grids of at least nine corners in a picture (H, W), the largest first."""
    smooth = np.asarray(cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 1.0), np.float32)
    saddles = _saddles(smooth)
    if len(saddles) == 0:
        return []
    edges, rises, is_corner = _edges_around(smooth, saddles)
    strongest = np.flatnonzero(is_corner)[:_MOST_CORNERS]
    saddles, edges, rises = saddles[strongest], edges[strongest], rises[strongest]
    if len(saddles) < _LEAST_CORNERS:
        return []
    neighbours, facing = _neighbours(saddles, edges, rises)
    neighbours = np.where(_around_squares(neighbours, facing), neighbours, -1)
    grids = _grown(saddles, rises, neighbours, facing)
    return sorted(grids, key=lambda grid: -len(grid.places))


def _saddles(smooth: NDArray[np.float32]) -> Array:
    """Return the strongest saddles of brightness (n, 2), to a tenth of a pixel."""
    dx, dy = (cv2.Sobel(smooth, cv2.CV_32F, *order, scale=1 / 8) for order in ((1, 0), (0, 1)))
    dxx, dyy = (cv2.Sobel(smooth, cv2.CV_32F, *order, scale=1 / 4) for order in ((2, 0), (0, 2)))
    dxy = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, scale=1 / 4)
    strength = dxy * dxy - dxx * dyy
    peak = (strength >= cv2.dilate(strength, np.ones((5, 5)))) & (strength > 1.0)
    margin = int(_RING_RADIUS_PX) + 2
    peak[:margin] = peak[-margin:] = peak[:, :margin] = peak[:, -margin:] = False
    rows, columns = np.nonzero(peak)
    strongest = np.argsort(-strength[rows, columns])[:_MOST_SADDLES]
    at = rows[strongest], columns[strongest]
    determinant = -strength[at]
    step_x = (dxy[at] * dy[at] - dyy[at] * dx[at]) / determinant
    step_y = (dxy[at] * dx[at] - dxx[at] * dy[at]) / determinant
    step = np.stack([step_x, step_y], axis=-1)
    near = np.all(np.abs(step) < 1.5, axis=-1)
    found = np.stack([at[1], at[0]], axis=-1) + step
    return np.asarray(found[near], np.float64)


def _edges_around(
    smooth: NDArray[np.float32], saddles: Array
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the four edges around each saddle, and whether it is a board's corner.

    As angles (n, 4) from +x toward +y, rising, and whether brightness rises (n, 4) with the angle.
    A corner has four, opposite ones in line to within the bend of a lens, between quarters of even
    contrast.
    """
    turn = 2 * np.pi * np.arange(_RING) / _RING
    ring = _RING_RADIUS_PX * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    places = (saddles[:, None] + ring).astype(np.float32)
    values = cv2.remap(smooth, places[..., 0], places[..., 1], cv2.INTER_LINEAR).astype(np.float64)
    values = values.reshape(len(saddles), _RING)
    low, high = np.percentile(values, [15, 85], axis=1)
    level = (values - ((low + high) / 2)[:, None]) / np.maximum(high - low, 1e-9)[:, None]
    following = np.roll(level, -1, axis=1)
    crossing = (level < 0) != (following < 0)
    is_corner = (crossing.sum(axis=1) == 4) & (high - low >= _LEAST_CONTRAST)
    edges = np.zeros((len(saddles), 4))
    rises = np.zeros((len(saddles), 4), np.bool_)
    which, step = np.nonzero(crossing & is_corner[:, None])
    before, after = level[which, step], following[which, step]
    angle = 2 * np.pi / _RING * (step + before / (before - after))
    edges[is_corner] = angle.reshape(-1, 4)
    rises[is_corner] = (after > before).reshape(-1, 4)
    bent = np.abs(_wrapped(edges[:, :2] + np.pi - edges[:, 2:]))
    is_corner &= np.all(bent < _BEND * 1.5, axis=1)
    return edges, rises, is_corner


def _neighbours(
    saddles: Array, edges: Array, rises: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return which saddle (n, 4) each edge leads to, −1 for none, and by which of its edges."""
    count = len(saddles)
    between = saddles[None] - saddles[:, None]
    distance = np.hypot(between[..., 0], between[..., 1])
    bearing = np.arctan2(between[..., 1], between[..., 0])
    off = np.abs(_wrapped(bearing[..., None] - edges[:, None, :]))
    edge = np.argmin(off, axis=-1)
    points_at = np.min(off, axis=-1) < _BEND
    rising = np.take_along_axis(rises, edge, axis=1)
    fits = points_at & points_at.T & (rising != rising.T) & (distance > _RING_RADIUS_PX)
    best = np.full((count, 4), -1, np.int64)
    for each in range(4):
        reach = np.where(fits & (edge == each), distance, np.inf)
        nearest = np.argmin(reach, axis=1)
        best[:, each] = np.where(np.isfinite(reach[np.arange(count), nearest]), nearest, -1)
    facing = edge.T[np.arange(count)[:, None], best]
    mutual = (best >= 0) & (best[best, facing] == np.arange(count)[:, None])
    best[~mutual] = -1
    return best, facing


def _around_squares(neighbours: NDArray[np.int64], facing: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which edges (n, 4) bound a closed ring of four neighbours on either side.

    Edges of other things join corners too, but rarely close a square.
    """
    count = len(neighbours)
    nothing = 4 * count  # a half-edge is 4 corner + edge; the one past the end leads nowhere
    twin = np.where(neighbours >= 0, 4 * neighbours + facing, nothing).ravel()
    following = np.where(twin == nothing, nothing, 4 * (twin // 4) + (twin + 3) % 4)
    following = np.append(following, nothing)
    end = np.arange(nothing)
    for _ in range(4):
        end = following[end]
    square = np.append(end == np.arange(nothing), False)
    return np.asarray((square[:-1] | square[twin]).reshape(count, 4))


def _grown(
    saddles: Array,
    rises: NDArray[np.bool_],
    neighbours: NDArray[np.int64],
    facing: NDArray[np.int64],
) -> list[CornerGrid]:
    """Return the grids that neighbours form; the shortest path to a corner gives its place."""
    steps = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    free = np.ones(len(saddles), np.bool_)
    grids = []
    for seed in np.argsort(-np.sum(neighbours >= 0, axis=1), kind="stable"):
        if not free[seed]:
            continue
        free[seed] = False
        place_of = {int(seed): (0, 0)}
        taken = {(0, 0): int(seed)}
        turn_of = {int(seed): 0}
        queue = deque([int(seed)])
        while queue:
            corner = queue.popleft()
            for edge in range(4):
                other = int(neighbours[corner, edge])
                if other < 0 or not free[other]:
                    continue
                direction = (edge + turn_of[corner]) % 4
                place = tuple((np.array(place_of[corner]) + steps[direction]).tolist())
                if place in taken:
                    continue
                free[other] = False
                place_of[other], taken[place] = place, other
                turn_of[other] = (direction + 2 - int(facing[corner, edge])) % 4
                queue.append(other)
        if len(taken) >= _LEAST_CORNERS:
            members = np.array(list(place_of))
            places = np.array(list(place_of.values()), np.int64)
            lowest = places.min(axis=0)
            # At a corner, the square beyond it up and to the left lies between the edges to the
            # left and up: it is light if brightness rises across the edge to the left.
            left = (2 - turn_of[int(seed)]) % 4
            dark_at_seed = not bool(rises[seed, left])
            dark_first = dark_at_seed != bool(lowest.sum() % 2)
            grids.append(CornerGrid(places - lowest, saddles[members], dark_first))
    return grids


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
