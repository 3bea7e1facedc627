"""Where a mirror ball may be in a picture: the cone that most edges agree on.

Input  : a linear picture, and roughly where the ball is, or nothing.
Output : a cone as calibration/ball_cone.py has it, to about 1 % of the radius.
Cost   : half a second without a rough circle, a tenth with one.
Fails  : where another round thing has the longer outline.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.ball_cone import Pinhole, cone_distance_px, spoke_radii, unit_rays
from calibration.ball_edges import edges_near
from capture.errors import InputError

Array = NDArray[np.float64]

LEAST_SUPPORT = 0.3
"""Share of the outline that must be seen."""
_SEARCH_PX = 360
"""Longer side of the picture in which the ball is looked for."""
_REACH = 0.15
"""How far a rough circle may be off, in radii."""
_SEARCH_TRIALS = 150
_SEARCH_SPACING_PX = 5.0


def search_ball(picture: NDArray[np.float32], pinhole: Pinhole) -> Array:
    """Return x, y and radius of the roundish shape with the longest outline."""
    height, width = picture.shape[:2]
    scale = min(_SEARCH_PX / max(height, width), 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    resized = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    smooth = np.asarray(cv2.GaussianBlur(resized, (0, 0), 1.0), np.float32)
    principal = (np.array(pinhole.principal_px) + 0.5) * scale - 0.5
    small = Pinhole(pinhole.focal_px * scale, (float(principal[0]), float(principal[1])))
    best, best_length = None, 0.0
    for rough in _rough_circles(smooth):
        count = int(np.ceil(2 * np.pi * rough[2] / _SEARCH_SPACING_PX))
        cone, support = cone_near(smooth, small, rough, count, _SEARCH_TRIALS)
        length = support**2 * rough[2]
        if support >= LEAST_SUPPORT and length > best_length:
            radius = spoke_radii(small, cone, 64).mean()
            best, best_length = np.append(cone[:2], radius), length
    if best is None:
        raise InputError("no ball found in the picture; say where it is with --ball x,y,radius")
    return np.append((best[:2] + 0.5) / scale - 0.5, best[2] / scale)


def cone_near(
    picture: NDArray[np.float32], pinhole: Pinhole, rough: Array, spoke_count: int, trials: int
) -> tuple[Array, float]:
    """Return the cone near a rough circle that most spokes have an edge on, and their share.

    Cones through three edges at random (RANSAC; the same ones every time) are tried.
    """
    radii_px = np.full(spoke_count, rough[2])
    edges = edges_near(picture, rough[:2], radii_px, _REACH * rough[2])
    best, best_share = np.append(rough[:2], rough[2] / pinhole.focal_px), 0.0
    if len(edges.spoke) < 3:
        return best, best_share
    tolerance_px = max(0.008 * rough[2], 1.0)
    rays, _ = unit_rays(pinhole, edges.points_px)
    rng = np.random.default_rng(0)
    for a, b, c in rays[rng.integers(0, len(rays), (trials, 3))]:
        axis = np.cross(b - a, c - a)
        if abs(axis[2]) <= 1e-3 * np.linalg.norm(b - a) * np.linalg.norm(c - a):
            continue  # in line, or one edge twice
        axis *= np.sign(axis[2])
        centre_px = pinhole.principal_px + pinhole.focal_px * axis[:2] / axis[2]
        if np.hypot(*(centre_px - rough[:2])) > 2 * _REACH * rough[2]:
            continue
        half_angle_rad = np.arctan2(np.linalg.norm(np.cross(a, axis)), a @ axis)
        cone = np.append(centre_px, half_angle_rad)
        near = np.abs(cone_distance_px(pinhole, cone, edges.points_px)) < tolerance_px
        share = np.count_nonzero(np.bincount(edges.spoke[near])) / edges.spoke_count
        if share > best_share:
            best, best_share = cone, share
    return best, best_share


def _rough_circles(picture: NDArray[np.float32]) -> Array:
    """Return candidates (n, 3), centre and radius.

    By Hough's transform in ranges of size, and about the picture's middle.
    """
    grey = np.sqrt(picture.mean(axis=-1))
    grey = np.clip(grey * (128 / max(float(np.median(grey)), 1e-12)), 0, 255).astype(np.uint8)
    grey = cv2.medianBlur(grey, 5)
    longest = max(grey.shape)
    middle_x, middle_y = (grey.shape[1] - 1) / 2, (grey.shape[0] - 1) / 2
    found = [np.array([[middle_x, middle_y, share * longest] for share in (0.2, 0.26, 0.33, 0.42)])]
    for least, most in ((0.06, 0.14), (0.12, 0.26), (0.22, 0.4), (0.35, 0.62)):
        circles = cv2.HoughCircles(
            grey,
            cv2.HOUGH_GRADIENT,
            dp=2,
            minDist=0.1 * longest,
            param1=80,
            param2=12,
            minRadius=int(least * longest),
            maxRadius=int(most * longest),
        )
        if circles is not None:
            found.append(circles.reshape(-1, 3)[:8])
    return np.concatenate(found)
