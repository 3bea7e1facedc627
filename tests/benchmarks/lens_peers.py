"""OpenCV's calibrations of a lens, as systems that tests/benchmarks/lens.py compares."""

from typing import Any

import cv2
import numpy as np

from calibration.board import Board
from calibration.lens.adjust import Solution
from calibration.lens.poses import Poses
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.unified import Unified
from calibration.observations import View

_NO_POSES = Poses(np.empty((0, 3, 3)), np.empty((0, 3)))


def fisheye(board: Board, views: list[View]) -> Solution:
    """OpenCV's Kannala-Brandt calibration, with the start that it needs: see its issue 23962."""
    width, height = views[0].size_px
    focal = width / np.pi
    start = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW | cv2.CALIB_USE_INTRINSIC_GUESS
    found = cv2.fisheye.calibrate(*_points(board, views), start, np.zeros((4, 1)), flags=flags)
    return _lens(KannalaBrandt, found[1], (), found[2])


def fisheye_default(board: Board, views: list[View]) -> Solution:
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    points = _points(board, views)
    found = cv2.fisheye.calibrate(*points, np.eye(3), np.zeros((4, 1)), flags=flags)
    return _lens(KannalaBrandt, found[1], (), found[2])


def omnidir(board: Board, views: list[View]) -> Solution:
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-8)
    found = cv2.omnidir.calibrate(
        *_points(board, views),
        np.eye(3),
        np.zeros((1, 1)),
        np.zeros((1, 4)),
        cv2.omnidir.CALIB_FIX_SKEW,
        criteria,
    )
    return _lens(Unified, found[1], found[2].ravel(), found[3])


def _points(board: Board, views: list[View]) -> tuple[list[Any], list[Any], tuple[int, int]]:
    on_board = [board.points_m()[view.point_ids][None] for view in views]
    return on_board, [np.array(view.corners_px)[None] for view in views], views[0].size_px


def _lens(model: Any, K: Any, shape: Any, distortion: Any) -> Solution:
    centre, focal = (float(K[0, 2]), float(K[1, 2])), (float(K[0, 0]), float(K[1, 1]))
    values = [float(each) for each in [*shape, *np.ravel(distortion)[:4]]]
    return Solution(model(centre, focal, *values), _NO_POSES)
