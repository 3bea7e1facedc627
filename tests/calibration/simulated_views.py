"""Views of a board through a lens that is known: what a calibration should find again."""

import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.camera import CameraModel
from calibration.observations import View

BOARD = Board("checkerboard", 9, 6, 0.03)


def simulated_views(
    model: CameraModel,
    size_px: tuple[int, int],
    count: int,
    random: np.random.Generator,
    *,
    board: Board = BOARD,
    noise_px: float = 0.1,
    most_angle_rad: float = np.deg2rad(80.0),
    most_tilt_rad: float = np.deg2rad(40.0),
    bend_m: float = 0.0,
) -> list[View]:
    """Return views of boards up to `most_angle_rad` from the axis, all corners in the picture."""
    points = board.points_m() - board.points_m().mean(axis=0)
    reach = np.abs(points).max(axis=0)
    points[:, 2] = bend_m * (2.0 - np.sum((points / np.where(reach > 0, reach, 1)) ** 2, axis=-1))
    views: list[View] = []
    while len(views) < count:
        in_camera = _placed(points, random, most_angle_rad, most_tilt_rad)
        pixels, seen = model.project(in_camera)
        angle = np.arctan2(np.hypot(in_camera[:, 0], in_camera[:, 1]), in_camera[:, 2])
        inside = np.all((pixels >= 0) & (pixels <= np.array(size_px) - 1.0))
        if seen.all() and inside and angle.max() <= most_angle_rad:
            views.append(view_of(f"view {len(views)}", size_px, pixels, random, noise_px))
    return views


def view_of(
    name: str,
    size_px: tuple[int, int],
    pixels: NDArray[np.float64],
    random: np.random.Generator,
    noise_px: float,
) -> View:
    count = len(pixels)
    noisy = pixels + noise_px * random.normal(size=pixels.shape)
    return View(name, size_px, np.arange(count), noisy, np.full(count, max(noise_px, 0.01)))


def _placed(
    points: NDArray[np.float64],
    random: np.random.Generator,
    most_angle_rad: float,
    most_tilt_rad: float,
) -> NDArray[np.float64]:
    """Return the points (N, 3) of a board somewhere before the camera, its face toward it."""
    angle, azimuth = random.uniform(0, most_angle_rad), random.uniform(0, 2 * np.pi)
    sine = np.sin(angle)
    towards = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(angle)])
    side = np.cross([0.0, 1.0, 0.1], towards)
    side /= np.linalg.norm(side)
    facing = np.stack([side, np.cross(towards, side), towards], axis=-1)
    tilts = random.uniform(-most_tilt_rad, most_tilt_rad, 3)
    turn = about(0, tilts[0]) @ about(1, tilts[1]) @ about(2, tilts[2])
    distance_m = random.uniform(0.25, 0.6)
    return points @ (facing @ turn).T + distance_m * towards


def about(axis: int, angle_rad: float) -> NDArray[np.float64]:
    """Return the rotation about an axis of the frame."""
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[[first, second], [first, second]] = np.cos(angle_rad)
    turn[first, second], turn[second, first] = -np.sin(angle_rad), np.sin(angle_rad)
    return turn
