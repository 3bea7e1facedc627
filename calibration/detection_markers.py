"""Coded markers read, and the board's points that they tell.

Input  : grey counts, (H, W) uint8, and a ChArUco board or Kalibr's grid of AprilTags.
Output : the points (rows, columns, 2) to a pixel or two, NaN where no marker tells one.
Markers are found in the picture itself and in flat views of it, drawn as if it came from an
equidistant fisheye: near the rim a marker's sides are bent too much to be taken for a square, and
in one of those views they are nearly straight, whatever the lens.
Fails  : a marker whose cells are smaller than two pixels. A ChArUco board with an even number of
rows that OpenCV before 4.6 printed begins with a light square: points are lost, or all are.
"""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.models.equidistant import Equidistant
from capture.errors import InputError

Array = NDArray[np.float64]

_UNIT_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

_AGREE = 0.25
"""How far two markers may put the same point apart, in sides of the smallest marker."""

_GUESSED_HALF_ANGLE_RAD = np.deg2rad(95.0)
"""Angle from the axis that the shorter side of the picture is taken to show."""

_FLAT_HALF_ANGLE_RAD = np.deg2rad(38.0)
"""Half the angle a flat view shows; five of them, 60° apart, cover the picture."""

_FLAT_TILT_RAD = np.deg2rad(60.0)


def find_marked_points(grey: NDArray[np.uint8], board: Board) -> Array:
    """Return the board's points (rows, columns, 2) in a picture (H, W), NaN for those not found."""
    detector = _detector(board)
    markers = _read_markers(detector, grey)
    lattice = _points_of(markers, board)
    if np.any(np.isnan(lattice)):
        for view, onto_picture in _flat_views(grey):
            for number, corners in _read_markers(detector, view).items():
                markers.setdefault(number, onto_picture(corners))
        lattice = _points_of(markers, board)
    return lattice


def _detector(board: Board) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMax = 43
    if board.pattern == "charuco":  # its corners are told from a marker's, which are some way off
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    if board.pattern == "apriltag":
        parameters.markerBorderBits = 2
        return cv2.aruco.ArucoDetector(_dictionary("APRILTAG_36h11"), parameters)
    return cv2.aruco.ArucoDetector(_dictionary(board.dictionary), parameters)


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    known = [each.removeprefix("DICT_") for each in dir(cv2.aruco) if each.startswith("DICT_")]
    if name not in known:
        raise InputError(f"dictionary {name!r}: wanted one of {', '.join(known)}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def _read_markers(detector: cv2.aruco.ArucoDetector, grey: NDArray[np.uint8]) -> dict[int, Array]:
    """Return the corners (4, 2) of the markers by their numbers, clockwise from the upper left."""
    found, numbers, _ = detector.detectMarkers(grey)
    if numbers is None:
        return {}
    corners = np.asarray(found, np.float64).reshape(-1, 4, 2)
    return dict(zip((int(number) for number in np.ravel(numbers)), corners, strict=True))


def _points_of(markers: dict[int, Array], board: Board) -> Array:
    """Return the points (rows, columns, 2) that markers tell, NaN where none does or two differ."""
    columns, rows = board.grid
    told: dict[tuple[int, int], list[Array]] = {}
    shortest = np.inf
    on_square, squares = _layout(board)
    for number, corners in markers.items():
        if number >= len(squares):
            continue
        column, row = squares[number]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        shortest = min(shortest, sides.min())
        onto_picture = cv2.getPerspectiveTransform(on_square, corners.astype(np.float32))
        around = cv2.perspectiveTransform(_UNIT_SQUARE[None], onto_picture)[0]
        for (x, y), corner in zip(_UNIT_SQUARE, around, strict=True):
            place = row + int(y), column + int(x)
            if 0 <= place[0] < rows and 0 <= place[1] < columns:
                told.setdefault(place, []).append(corner)
    lattice = np.full((rows, columns, 2), np.nan)
    for place, corners_told in told.items():
        if np.ptp(corners_told, axis=0).max() <= _AGREE * shortest:
            lattice[place] = np.mean(corners_told, axis=0)
    return lattice


def _layout(board: Board) -> tuple[NDArray[np.float32], list[tuple[int, int]]]:
    """Return a marker's corners (4, 2) in its square, and the column and row of every square.

    A square reaches from a point to the next; the squares are in the order of their markers'
    numbers.
    """
    columns, rows = range(board.columns), range(board.rows)
    if board.pattern == "apriltag":
        # Kalibr counts from the lower left, and prints the tags half a turn against OpenCV's.
        squares = [(2 * column, 2 * row) for row in reversed(rows) for column in columns]
        return np.roll(_UNIT_SQUARE, 2, axis=0).astype(np.float32), squares
    margin = (1 - board.marker_ratio) / 2
    on_square = (margin + board.marker_ratio * _UNIT_SQUARE).astype(np.float32)
    # The markers stand in the light squares; the first point is the lower right of the first one.
    squares = [
        (column - 1, row - 1) for row in rows for column in columns if (column + row) % 2 == 1
    ]
    return on_square, squares


def _flat_views(
    grey: NDArray[np.uint8],
) -> list[tuple[NDArray[np.uint8], Callable[[Array], Array]]]:
    """Return flat views of a picture, and for each what takes its pixels (n, 2) to the picture."""
    height, width = grey.shape
    focal_px = min(width, height) / 2 / _GUESSED_HALF_ANGLE_RAD
    lens = Equidistant(((width - 1) / 2, (height - 1) / 2), focal_px)
    side = round(2.2 * focal_px * np.tan(_FLAT_HALF_ANGLE_RAD)) | 1
    middle = (side - 1) / 2
    flat_focal_px = side / 2 / np.tan(_FLAT_HALF_ANGLE_RAD)
    views: list[tuple[NDArray[np.uint8], Callable[[Array], Array]]] = []
    for tilt in [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]:
        rotation = cv2.Rodrigues(_FLAT_TILT_RAD * np.array([*tilt, 0.0]))[0]

        def onto_picture(pixels: Array, rotation: Array = rotation) -> Array:
            offsets = (pixels - middle) / flat_focal_px
            rays = np.concatenate([offsets, np.ones_like(offsets[..., :1])], axis=-1)
            return lens.project(rays @ rotation.T)[0]

        grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1)
        at = onto_picture(grid.astype(np.float64)).astype(np.float32)
        view = cv2.remap(grey, at[..., 0], at[..., 1], cv2.INTER_CUBIC)
        views.append((np.asarray(view, np.uint8), onto_picture))
    return views
