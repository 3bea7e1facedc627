"""The cone of rays that graze a mirror ball, and its outline in a pinhole's picture.

Domain : a cone is three numbers, (3,): the pixel x, y of its axis, where the ball's centre is seen,
and half its angle in rad. Its outline is an ellipse, and about a circle if the cone is narrow.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.ball_edges import spoke_directions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pinhole:
    """A camera without distortion: its focal length and where its axis meets the picture."""

    focal_px: float
    principal_px: tuple[float, float]


def distant_pinhole(size_px: tuple[int, int]) -> Pinhole:
    """Return a camera so far off that the outline of a ball is a circle wherever it is."""
    width, height = size_px
    return Pinhole(1e4 * max(width, height), ((width - 1) / 2, (height - 1) / 2))


def cone_distance_px(pinhole: Pinhole, cone: Array, points: Array) -> Array:
    """Return how far points (n, 2) lie outside a cone's outline, in pixels, to first order.

    `cone` is the pixel x, y of its axis and half its angle in rad.
    """
    axis = np.append((cone[:2] - pinhole.principal_px) / pinhole.focal_px, 1.0)
    axis /= np.linalg.norm(axis)
    rays, lengths = unit_rays(pinhole, points)
    across = np.linalg.norm(np.cross(rays, axis), axis=1)
    cosine = rays @ axis
    slope = (axis[:2] - cosine[:, None] * rays[:, :2]) / lengths[:, None]
    rad_per_px = np.linalg.norm(slope, axis=1) / np.maximum(across, 1e-300) / pinhole.focal_px
    return (np.arctan2(across, cosine) - cone[2]) / rad_per_px


def unit_rays(pinhole: Pinhole, points: Array) -> tuple[Array, Array]:
    """Return unit rays (n, 3) of pixels (n, 2), and their lengths (n,) before that, at z = 1."""
    at = (points - pinhole.principal_px) / pinhole.focal_px
    rays = np.concatenate([at, np.ones((len(at), 1))], axis=1)
    lengths = np.linalg.norm(rays, axis=1)
    return rays / lengths[:, None], lengths


def spoke_radii(pinhole: Pinhole, cone: Array, count: int) -> Array:
    """Return the radii (count,) of a cone's outline about the pixel of its axis."""
    outward = spoke_directions(count)
    radii = np.full(count, pinhole.focal_px * np.tan(cone[2]))
    for _ in range(6):  # each step errs by the share by which the outline is not a circle
        radii -= cone_distance_px(pinhole, cone, cone[:2] + radii[:, None] * outward)
    return radii
