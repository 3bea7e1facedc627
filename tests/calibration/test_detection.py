"""Boards found in pictures of known lenses, and in photographs.

The lens shows 194° in 480 pixels: 140 px a radian, the coarsest that is of use. Its boards bend by
up to a third of their height at the rim.
"""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.board import Board, parse_board
from calibration.detection import detect_board
from calibration.detection_files import detect_views, read_grey
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.observations import Rejected, View
from capture.errors import InputError
from capture.pictures import write_png
from tests.calibration.synthetic_boards import board_pose, render_board, true_corners

_DATA = Path(__file__).resolve().parents[2].parent / "shared/data"

LENS = KannalaBrandt((240.3, 239.6), 140.0, -0.01, 0.002, -0.001, 0.0)
SIZE = (480, 480)
CHECKERBOARD = parse_board("7x6", 0.03)

RIM = (1.3, 0.25)
"""Angle from the axis of a board's middle, and its distance: its far side is at 96°."""


@cache
def _picture(
    board: Board, turn_rad: float = 0.4, noise: float = 1.5, azimuth_rad: float = 0.6
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    pose = board_pose(RIM[0], azimuth_rad, RIM[1], board, (0.1, 0.2, turn_rad))
    picture = render_board(LENS, SIZE, board, *pose, noise=noise)
    return picture, true_corners(LENS, board, *pose)


def _view(found: View | Rejected) -> View:
    assert isinstance(found, View), found
    return found


def _check_places(view: View, truth: NDArray[np.float64]) -> None:
    off = np.abs(view.corners_px - truth[view.point_ids]).max(axis=1)
    assert np.all(off < 0.05 + 4 * view.corner_sigma_px)


@pytest.mark.parametrize("turn_rad", [0.4, 2.0])
def test_a_board_bent_at_the_rim_is_found_in_its_own_order(turn_rad: float) -> None:
    picture, truth = _picture(CHECKERBOARD, turn_rad)
    view = _view(detect_board(picture, CHECKERBOARD, "rim"))
    assert view.name == "rim"
    assert view.size_px == SIZE
    np.testing.assert_array_equal(view.point_ids, np.arange(42))
    error = view.corners_px - truth
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.abs(error).max() < 0.08


def test_bent_edges_are_followed_where_straight_ones_mislead() -> None:
    picture, truth = _picture(CHECKERBOARD)
    view = _view(detect_board(picture, CHECKERBOARD, ""))
    straight = cv2.cornerSubPix(
        picture, truth.astype(np.float32)[:, None].copy(), (4, 4), (-1, -1), (3, 50, 1e-3)
    )[:, 0]
    ours, theirs = (np.sqrt(np.mean((at - truth) ** 2)) for at in (view.corners_px, straight))
    assert ours < theirs / 4


def test_clipped_whites_do_not_matter() -> None:
    # At twice the light the edges look moved into the dark squares, by most of a pixel.
    pose = board_pose(1.0, 0.6, 0.2, CHECKERBOARD, (0.1, 0.2, 0.4))
    picture = render_board(LENS, SIZE, CHECKERBOARD, *pose, noise=0.0, blur_px=1.5)
    noise = np.random.default_rng(0).normal(0.0, 1.5, picture.shape)
    overexposed = np.clip(np.rint(2.0 * (picture - 20.0) + noise), 0, 255).astype(np.uint8)
    view = _view(detect_board(overexposed, CHECKERBOARD, ""))
    error = view.corners_px - true_corners(LENS, CHECKERBOARD, *pose)[view.point_ids]
    assert len(view) == 42
    assert np.sqrt(np.mean(error**2)) < 0.009
    assert np.median(view.corner_sigma_px) < 0.01


def test_sigma_is_what_corners_are_off_by() -> None:
    errors = []
    for azimuth in (0.0, 1.5):
        picture, truth = _picture(CHECKERBOARD, noise=6.0, azimuth_rad=azimuth)
        view = _view(detect_board(picture, CHECKERBOARD, ""))
        off = view.corners_px - truth[view.point_ids]
        errors.append(off / view.corner_sigma_px[:, None])
    # 84 corners of two coordinates: the spread is known to 1/√(2 · 168), that is 5.5 %.
    assert 0.75 < np.sqrt(np.mean(np.concatenate(errors) ** 2)) < 1.25


def test_a_board_that_half_a_turn_takes_to_itself_begins_up_and_left() -> None:
    board = parse_board("6x4", 0.03)
    first = []
    for turn in (0.4, 0.4 + np.pi):
        picture, _ = _picture(board, turn)
        view = _view(detect_board(picture, board, ""))
        first.append(view.corners_px[0])
        rows = view.corners_px.reshape(4, 6, 2)
        assert rows[0].sum() < rows[-1].sum()
        along, down = rows[0, 1] - rows[0, 0], rows[1, 0] - rows[0, 0]
        assert along[0] * down[1] - along[1] * down[0] > 0
    assert np.abs(first[0] - first[1]).max() < 30  # of a board that is 150 px wide


def test_a_cluttered_room_does_not_join_the_board() -> None:
    picture, truth = _picture(CHECKERBOARD, noise=0.0)
    noise = np.random.default_rng(3).normal(size=picture.shape)
    clutter = 140 + 400 * cv2.GaussianBlur(noise, (0, 0), 2.5)
    cluttered = np.where(picture == 140, np.clip(clutter, 0, 255), picture).astype(np.uint8)
    view = _view(detect_board(cluttered, CHECKERBOARD, ""))
    np.testing.assert_array_equal(view.point_ids, np.arange(42))
    _check_places(view, truth)


def test_hidden_corners_are_left_out_and_the_others_keep_their_numbers() -> None:
    picture, truth = _picture(CHECKERBOARD)
    middle = truth[17].round().astype(int)
    picture = cv2.circle(picture.copy(), tuple(middle.tolist()), 9, (140,), -1)
    view = _view(detect_board(picture, CHECKERBOARD, ""))
    assert 17 not in view.point_ids
    assert len(view.point_ids) >= 30
    assert np.abs(view.corners_px - truth[view.point_ids]).max() < 0.15


def test_a_line_that_is_mostly_hidden_does_not_count() -> None:
    # Of 8 × 6 corners all but two of the first column are hidden. Beyond the first of the 7 × 6
    # that are left lies a light square, so that they are a board that begins at the other end.
    picture, truth = _picture(parse_board("8x6", 0.03))
    picture = picture.copy()
    for corner in truth[[0, 8, 16, 24]]:
        cv2.circle(picture, tuple(corner.round().astype(int).tolist()), 8, (225,), -1)
    view = _view(detect_board(picture, CHECKERBOARD, ""))
    assert len(view) >= 36
    _check_places(view, truth.reshape(6, 8, 2)[::-1, :0:-1].reshape(-1, 2))


def test_a_board_of_another_size_is_named() -> None:
    picture, _ = _picture(CHECKERBOARD)
    found = detect_board(picture, parse_board("8x6", 0.03), "img1")
    assert isinstance(found, Rejected)
    assert found.seen_grid == (7, 6)
    assert "7×6 inner corners were found, wanted 8×6" in found.reason


def test_a_picture_without_a_board_is_rejected() -> None:
    texture = np.random.default_rng(0).integers(0, 255, (300, 400)).astype(np.uint8)
    for picture in (texture, np.full((300, 400), 90, np.uint8)):
        found = detect_board(picture, CHECKERBOARD, "empty")
        assert found == Rejected("empty", "no checkerboard was found")


@pytest.mark.parametrize(
    ("word", "square_m"), [("charuco:6x5:4X4_50:0.75", 0.06), ("apriltag:3x2:0.3", 0.08)]
)
def test_marked_boards_are_numbered_even_where_they_are_cut(word: str, square_m: float) -> None:
    board = parse_board(word, square_m)
    pose = board_pose(1.1, 0.6, 0.25, board, (0.1, 0.2, 2.5))
    picture = render_board(LENS, SIZE, board, *pose)
    truth = true_corners(LENS, board, *pose)
    whole = _view(detect_board(picture, board, ""))
    assert len(whole) >= 0.75 * len(truth)
    _check_places(whole, truth)
    cut = picture[:, : int(np.quantile(truth[:, 0], 0.7))].copy()
    part = _view(detect_board(cut, board, ""))
    assert 8 <= len(part) < 0.75 * len(truth)
    _check_places(part, truth)


def test_an_unknown_dictionary_is_refused_with_the_known_ones() -> None:
    board = parse_board("charuco:6x5:5X5_99:0.5", 0.06)
    with pytest.raises(InputError, match=r"dictionary '5X5_99': wanted one of .*5X5_100"):
        detect_board(np.zeros((60, 80), np.uint8), board, "")


def test_a_corner_just_outside_the_picture_is_not_made_up() -> None:
    # Squares of 100 px: cut 3 px beyond the first column of corners, whose markers are still whole.
    board = parse_board("charuco:6x5:4X4_50:0.5", 0.06)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    printed = cv2.aruco.CharucoBoard((6, 5), 1.0, 0.5, dictionary)
    flat = cv2.GaussianBlur(printed.generateImage((600, 500)), (0, 0), 0.7)
    columns = {}
    for cut in (90, 103):
        view = _view(detect_board(flat[:, cut:].copy(), board, ""))
        columns[cut] = set((view.point_ids % 5).tolist())
    assert columns == {90: {0, 1, 2, 3, 4}, 103: {1, 2, 3, 4}}


def test_pictures_of_several_sizes_are_refused_and_the_odd_ones_listed(tmp_path: Path) -> None:
    for name, shape in (("a", (40, 60)), ("b", (40, 60)), ("turned", (60, 40))):
        write_png(tmp_path / f"{name}.png", np.zeros((*shape, 3), np.uint8))
    with pytest.raises(InputError, match=r"2 of 3 pictures are 60×40 px, but not turned.png") as e:
        detect_views(sorted(tmp_path.iterdir()), CHECKERBOARD)
    assert "as the camera stored them, not turned" in str(e.value)


def test_a_wrong_count_in_all_pictures_is_refused_with_the_right_one(tmp_path: Path) -> None:
    picture, _ = _picture(CHECKERBOARD)
    for name in ("a", "b"):
        write_png(tmp_path / f"{name}.png", np.repeat(picture[..., None], 3, axis=2))
    (tmp_path / "c.png").write_bytes((tmp_path / "a.png").read_bytes()[:2000])
    paths = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match=r"2 of 3 pictures .* give --board 7x6"):
        detect_views(paths, parse_board("8x7", 0.03))
    found = detect_views(paths, CHECKERBOARD)
    assert [type(each) for each in found] == [View, View, Rejected]
    assert isinstance(found[2], Rejected)
    assert "c.png" in found[2].reason


def test_sixteen_bits_are_stretched_to_the_brightest(tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(0, 4000, 100).astype(np.uint16), (50, 1))
    write_png(tmp_path / "ramp.png", np.repeat(ramp[..., None], 3, axis=2))
    grey = read_grey(tmp_path / "ramp.png")
    assert grey.dtype == np.uint8
    assert grey.max() == 255
    np.testing.assert_allclose(grey[0], ramp[0] / 4000 * 255, atol=1.1)


@pytest.mark.data
@pytest.mark.parametrize(
    ("picture", "word", "corners"),
    [
        ("calib-urban-fisheye/Fisheye1_7.jpg", "8x6", 48),
        ("calib-urban-fisheye/Fisheye2_5.jpg", "8x6", 48),
        ("calib-camodocal/img2.png", "9x6", 54),
        ("calib-kaidan-catadioptric/example/KaidanOmni1.jpg", "11x7", 77),
        ("calib-kaidan-catadioptric/example/KaidanOmni8.jpg", "11x7", 60),
        ("calib-adapter-samples/kalibr/image.png", "apriltag:6x6:0.3", 130),
    ],
)
def test_boards_in_photographs(picture: str, word: str, corners: int) -> None:
    path = _DATA / picture
    if not path.exists():
        pytest.skip(f"{path} is not here")
    view = _view(detect_board(read_grey(path), parse_board(word, 0.03), path.name))
    assert len(view) >= corners
    assert np.median(view.corner_sigma_px) < 0.06
