"""Pictures of boards that a known lens would take, and where the board's points truly are in them.

The board's print is exact, a pixel is the mean over its square of the blurred picture, and noise is
added after that: what a detection is off by is its own.
"""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.camera import CameraModel

_TEXELS = 40
"""Texels along a square or a tag's cell, of prints that are no closed form."""

_ROOM = 140.0


def board_pose(
    angle_rad: float,
    azimuth_rad: float,
    distance_m: float,
    board: Board,
    tilt_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return R_camera_board and t (3,) of a board whose middle lies in a direction and faces it.

    It stands `angle_rad` from the camera's +z at `azimuth_rad` (from +x toward +y), and is then
    turned about its own middle by the rotation vector `tilt_rad`.
    """
    toward = np.array(
        [
            np.sin(angle_rad) * np.cos(azimuth_rad),
            np.sin(angle_rad) * np.sin(azimuth_rad),
            np.cos(angle_rad),
        ]
    )
    away_from_axis = np.cross([0.0, 0.0, 1.0], toward)
    sine = np.linalg.norm(away_from_axis)
    axis = away_from_axis / sine if sine > 0 else np.zeros(3)
    facing, _ = cv2.Rodrigues(axis * angle_rad)
    rotation = facing @ cv2.Rodrigues(np.array(tilt_rad, np.float64))[0]
    middle = board.points_m().mean(axis=0)
    return rotation, distance_m * toward - rotation @ middle


def true_corners(
    model: CameraModel, board: Board, rotation: NDArray[np.float64], shift_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the pixels (N, 2) of the board's points."""
    return model.project(board.points_m() @ rotation.T + shift_m)[0]


def render_board(
    model: CameraModel,
    size_px: tuple[int, int],
    board: Board,
    rotation: NDArray[np.float64],
    shift_m: NDArray[np.float64],
    *,
    noise: float = 1.5,
    blur_px: float = 0.6,
    samples: int = 3,
    seed: int = 0,
) -> NDArray[np.uint8]:
    """Return the picture (H, W) of a board in a plain grey room.

    Parameters
    ----------
    noise, blur_px : float
        Standard deviations: of a count, and of the lens's blur.
    samples : int
        Rays along a pixel's side.
    """
    width, height = size_px
    fine = np.full((height * samples, width * samples), _ROOM, np.float32)
    left, top, right, bottom = _surroundings(model, size_px, board, rotation, shift_m)
    x = (np.arange(left * samples, right * samples) + 0.5) / samples - 0.5
    y = (np.arange(top * samples, bottom * samples) + 0.5) / samples - 0.5
    pixels = np.stack(np.meshgrid(x, y), axis=-1)
    directions, valid = model.unproject(pixels)
    in_board = directions @ rotation
    origin = -rotation.T @ shift_m
    with np.errstate(invalid="ignore", divide="ignore"):
        reach = -origin[2] / in_board[..., 2]
        at = origin[:2] + reach[..., None] * in_board[..., :2]
        shown = valid & (reach > 0) & (in_board[..., 2] > 0)
    at[~shown] = 1e9
    region = fine[top * samples : bottom * samples, left * samples : right * samples]
    counts, printed = _print(board, at / board.square_m)
    region[printed] = counts[printed]
    if blur_px > 0:
        fine = cv2.GaussianBlur(fine, (0, 0), blur_px * samples)
    picture = fine.reshape(height, samples, width, samples).mean(axis=(1, 3))
    picture += np.random.default_rng(seed).normal(0.0, noise, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _surroundings(
    model: CameraModel,
    size_px: tuple[int, int],
    board: Board,
    rotation: NDArray[np.float64],
    shift_m: NDArray[np.float64],
) -> tuple[int, int, int, int]:
    """Return the left, top, right and bottom pixels that hold the board and its margin."""
    points = board.points_m()
    margin = 2.5 * board.square_m
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    u, v = np.meshgrid(np.linspace(low[0], high[0], 40), np.linspace(low[1], high[1], 40))
    sheet = np.stack([u, v, np.zeros_like(u)], axis=-1)
    pixels, valid = model.project(sheet @ rotation.T + shift_m)
    pixels = pixels[valid]
    left, top = np.maximum(np.floor(pixels.min(axis=0)) - 2, 0).astype(int)
    right, bottom = np.minimum(np.ceil(pixels.max(axis=0)) + 3, size_px).astype(int)
    return int(left), int(top), int(right), int(bottom)


def _print(board: Board, at: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the print's counts (…) at places (…, 2) in squares, and where there is a board."""
    if board.pattern == "checkerboard":
        return _checkerboard(board.grid, at)
    texture, origin, texels = _texture(board)
    texel = np.floor((at - origin) * texels).astype(np.int64)
    height, width = texture.shape
    on_sheet = np.all((texel >= 0) & (texel < [width, height]), axis=-1)
    texel[~on_sheet] = 0
    return 25 + texture[texel[..., 1], texel[..., 0]] * np.float32(200 / 255), on_sheet


def _checkerboard(
    grid: tuple[int, int], at: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return what `_print` does, with the lines between corners averaged over a ray's footprint.

    Without that an edge along the pixels' rows is rounded to the rays', an eighth of a pixel off.
    """
    line = np.clip(np.rint(at), 0, np.array(grid) - 1)
    footprint = np.sum([np.abs(np.gradient(at, axis=axis)) for axis in (0, 1)], axis=0)
    side = np.clip(2 * (at - line) / np.maximum(footprint, 1e-9), -1, 1) * (1 - 2 * (line % 2))
    inside = np.all((at >= -1) & (at < grid), axis=-1)
    light = np.where(inside, 0.5 - side.prod(axis=-1) / 2, 1.0)
    on_sheet = np.all((at > -1.7) & (at < np.array(grid) + 0.7), axis=-1)
    return (25 + 200 * light).astype(np.float32), on_sheet


@cache
def _texture(board: Board) -> tuple[NDArray[np.uint8], NDArray[np.float64], float]:
    """Return a print (h, w), the place of its corner in squares, and its texels a square."""
    if board.pattern == "charuco":
        dictionary = cv2.aruco.getPredefinedDictionary(
            getattr(cv2.aruco, f"DICT_{board.dictionary}")
        )
        print_size = (board.columns * _TEXELS, board.rows * _TEXELS)
        charuco = cv2.aruco.CharucoBoard(
            (board.columns, board.rows), 1.0, board.marker_ratio, dictionary
        )
        sheet = charuco.generateImage(print_size, marginSize=0, borderBits=1)
        margin = _TEXELS // 2
        framed = cv2.copyMakeBorder(*[sheet] + [margin] * 4, cv2.BORDER_CONSTANT, value=255)
        return framed, np.array([-1.5, -1.5]), _TEXELS
    return _tag_grid(board)


def _tag_grid(board: Board) -> tuple[NDArray[np.uint8], NDArray[np.float64], float]:
    """Return Kalibr's aprilgrid: a black square in every gap's crossing, tag 0 at the lower left.

    Kalibr prints the tags turned by half a turn against OpenCV's, as the photograph of one in
    ../shared/data/calib-adapter-samples shows.
    """
    cells = 10  # 6 of the code, a border of two on each side
    tag = cells * 8
    gap = round(board.gap_ratio * tag)
    assert gap == board.gap_ratio * tag, "choose a gap of whole texels"
    width = board.columns * (tag + gap) + gap
    height = board.rows * (tag + gap) + gap
    sheet = np.full((height, width), 255, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for row in range(board.rows + 1):
        for column in range(board.columns + 1):
            y, x = row * (tag + gap), column * (tag + gap)
            sheet[y : y + gap, x : x + gap] = 0
            if row < board.rows and column < board.columns:
                number = (board.rows - 1 - row) * board.columns + column
                printed = cv2.aruco.generateImageMarker(dictionary, number, tag, borderBits=2)
                sheet[y + gap : y + gap + tag, x + gap : x + gap + tag] = printed[::-1, ::-1]
    margin = tag // 2
    framed = cv2.copyMakeBorder(*[sheet] + [margin] * 4, cv2.BORDER_CONSTANT, value=255)
    corner = -(gap + margin) / tag
    return framed, np.array([corner, corner]), float(tag)
