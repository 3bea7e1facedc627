"""Boards: their points, by hand, and the words that name them."""

import numpy as np
import pytest

from calibration.board import Board, parse_board
from capture.errors import InputError


def test_checkerboard_points_run_along_rows_from_the_first_corner() -> None:
    points = parse_board("4x3", 0.02).points_m()
    assert points.shape == (12, 3)
    np.testing.assert_allclose(points[[0, 1, 4, 11]], 0.02 * np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [3, 2, 0]]
    ))  # fmt: skip


def test_charuco_counts_squares_and_has_the_corners_between_them() -> None:
    board = parse_board("charuco:8x5:5x5_100:0.75", 0.03)
    assert board == Board("charuco", 8, 5, 0.03, marker_ratio=0.75, dictionary="5X5_100")
    assert board.grid == (7, 4)
    np.testing.assert_allclose(board.points_m()[8], [0.03, 0.03, 0.0])


def test_tags_have_four_corners_each_and_a_gap_between() -> None:
    # Tags of 10 cm, 3 cm apart: corners at 0, 10, 13, 23 cm in either direction.
    points = parse_board("apriltag:2x2:0.3", 0.1).points_m().reshape(4, 4, 3)
    np.testing.assert_allclose(points[0, :, 0], [0.0, 0.1, 0.13, 0.23])
    np.testing.assert_allclose(points[:, 0, 1], [0.0, 0.1, 0.13, 0.23])


@pytest.mark.parametrize(
    "word",
    ["9by6", "9", "9x6:0.3", "charuco:8x5", "charuco:8x5:0.75", "apriltag:6x6", "checker:9x6"],
)
def test_another_word_is_refused_with_the_forms_that_are_known(word: str) -> None:
    with pytest.raises(InputError, match=r"such as 9x6, or charuco:.*apriltag:6x6:0.3"):
        parse_board(word, 0.03)


@pytest.mark.parametrize("word", ["2x6", "charuco:8x5:5X5_100:1.5", "apriltag:0x3:0.3"])
def test_a_board_that_cannot_be_is_refused_by_name(word: str) -> None:
    with pytest.raises(InputError, match=f"board '{word}'"):
        parse_board(word, 0.03)


def test_a_side_must_have_a_length() -> None:
    with pytest.raises(InputError, match="side of a square must be positive"):
        parse_board("9x6", 0.0)
