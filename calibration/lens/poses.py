"""Where a flat board stands, from the directions in which its points are seen; past 90° too.

Domain : transforms take board coordinates to the camera's: X_camera = R X_board + t, in metres.
Source : the direct linear transformation of a plane to directions, b × H (x, y, 1) = 0 with
H ∝ (r1 r2 t), as in J. Kannala, S. Brandt, PAMI 28(8), 2006, but on the sphere: directions are
never divided by z, and the sign of H is that which puts the points in front of their directions.
Fails  : for fewer than four corners, or corners in a line.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.lens.corners import Corners

Array = NDArray[np.float64]

_LEAST_CORNERS = 4


@dataclass(frozen=True, eq=False)
class Poses:
    """One board pose a view.

    Attributes
    ----------
    R_camera_board : (V, 3, 3) float64
    t_camera_board_m : (V, 3) float64
        The board's origin in the camera frame.
    """

    R_camera_board: Array
    t_camera_board_m: Array

    def views(self, chosen: NDArray[np.int64]) -> "Poses":
        """Return the poses of the chosen views."""
        return Poses(self.R_camera_board[chosen], self.t_camera_board_m[chosen])

    def of_corners(self, corners: Corners) -> tuple[Array, Array]:
        """Return R (N, 3, 3) and t (N, 3) for each corner."""
        view = corners.view_of
        return self.R_camera_board[view], self.t_camera_board_m[view]


def poses_from_directions(
    corners: Corners, directions: Array, valid: NDArray[np.bool_]
) -> tuple[Poses, Array]:
    """Return the poses, and the rms angle (V,) in rad by which they miss the directions (N, 3).

    A view with fewer than four valid directions has pose NaN and misses by π.
    """
    x, y = corners.points_m[:, 0], corners.points_m[:, 1]
    length_m = float(np.ptp(corners.points_m[:, :2], axis=0).max())
    plane = np.stack([x / length_m, y / length_m, np.ones_like(x)], axis=-1)
    seen = np.where(valid[:, None], directions, 0.0)
    rows = _cross_matrices(seen)[:, :, :, None] * plane[:, None, None, :]
    per_view = (rows[corners.of_view(view)].reshape(-1, 9) for view in range(corners.view_count))
    H = np.linalg.eigh(np.stack([each.T @ each for each in per_view]))[1][:, :, 0]
    H = H.reshape(-1, 3, 3)

    mapped = np.einsum("nij,nj->ni", H[corners.view_of], plane)
    ahead = _sum_by_view(corners, np.sum(mapped * seen, axis=-1))
    H = H * np.where(ahead < 0, -1.0, 1.0)[:, None, None]
    scale = np.linalg.norm(H[:, :, :2], axis=1).mean(axis=-1)
    rotation = _nearest_rotation(H[:, :, 0], H[:, :, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        translation = H[:, :, 2] * (length_m / scale)[:, None]
    enough = _sum_by_view(corners, valid.astype(np.float64)) >= _LEAST_CORNERS
    translation[~enough] = np.nan
    poses = Poses(rotation, translation)
    return poses, _miss_rad(corners, poses, seen, valid)


def rotations_about(turns_rad: Array) -> Array:
    """Return the rotations (V, 3, 3) about the vectors (V, 3) by their lengths (Rodrigues)."""
    angle = np.linalg.norm(turns_rad, axis=-1)
    axis = turns_rad / np.maximum(angle, 1e-300)[:, None]
    x, y, z = axis.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * cross @ cross)


def _miss_rad(corners: Corners, poses: Poses, directions: Array, valid: NDArray[np.bool_]) -> Array:
    R, t = poses.of_corners(corners)
    towards = np.einsum("nij,nj->ni", R, corners.points_m) + t
    sine = np.linalg.norm(np.cross(towards, directions), axis=-1)
    cosine = np.sum(towards * directions, axis=-1)
    squared = np.where(valid, np.arctan2(sine, cosine) ** 2, 0.0)
    count = np.maximum(_sum_by_view(corners, valid.astype(np.float64)), 1.0)
    miss = np.sqrt(_sum_by_view(corners, squared) / count)
    return np.where(np.isfinite(miss), miss, np.pi)


def _nearest_rotation(first: Array, second: Array) -> Array:
    """Return the rotations (V, 3, 3) whose first columns are nearest to two vectors (V, 3)."""
    third = np.cross(first, second)
    length = np.linalg.norm(first, axis=-1, keepdims=True)
    third = third / np.maximum(length, 1e-300)
    left, _, right = np.linalg.svd(np.stack([first, second, third], axis=-1))
    sign = np.linalg.det(left @ right)
    left[:, :, 2] *= sign[:, None]
    return np.asarray(left @ right)


def _cross_matrices(vectors: Array) -> Array:
    """Return the matrices (N, 3, 3) that take w to v × w."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -z, y, -x
    matrices[:, 1, 0], matrices[:, 2, 0], matrices[:, 2, 1] = z, -y, x
    return matrices


def _sum_by_view(corners: Corners, values: Array) -> Array:
    """Return the sums (V, …) of values (N, …) over the corners of each view."""
    sums = np.zeros((corners.view_count, *values.shape[1:]))
    np.add.at(sums, corners.view_of, values)
    return sums
