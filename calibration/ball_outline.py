"""The outline of a mirror ball in a picture, found and fitted to a fraction of a pixel.

Input  : a linear picture, the camera's focal length, and roughly where the ball is, if known.
Output : Outline, the cone of rays that graze the ball.
A sphere off the camera's axis has an elliptic outline. On the sphere of directions it is a circle,
whatever the place: three edges determine it, and its three numbers, where the ball's centre is and
how large it appears, are fitted to the edges themselves.
Cost   : about a second, half of it the search without a hint.
Fails  : where less than a third of the outline stands out from the background. Without a focal
length the outline is taken for a circle (`distant_pinhole`): off the axis by ψ it is longer than
wide by 1/cos ψ, 1.5 % at 10°, and directions near the outline are off by ten degrees.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibration.ball_edges import Edges, edges_near, spoke_directions
from capture.errors import InputError

Array = NDArray[np.float64]

_LEAST_SUPPORT = 0.3
"""Share of the outline that must be seen."""
_LEAST_RADIUS_PX = 20.0
_SEARCH_PX = 360
"""Longer side of the picture in which the ball is looked for."""
_REACH = 0.15
"""How far a rough circle may be off, in radii."""
_TRIALS = 500
_SEARCH_TRIALS = 150
_SMOOTHING_PX = 0.5
"""Enough against noise; more lets reflections beside the outline pull at it."""
_SPOKE_SPACING_PX = 1.5
_SEARCH_SPACING_PX = 5.0
_MOST_SPOKES = 1440
_OUTLIER_PX = 0.25
"""Distance from which on an edge counts less."""
_MOST_RESIDUAL_PX = 0.5
"""Of a sharp outline it is 0.04 to 0.35 px; edges by chance have 0.7 and more."""
_BESIDE_PX = (-5.0, -3.5, 3.5, 5.0)
_LEAST_CONCENTRATION = 1.7
"""How many more spokes must have an edge on the outline, within a pixel, than 3.5 to 5 px beside
it. In noise there are 1.3 times as many where there are most."""
_ARCS = 24
"""Parts of the outline that are left out in turn to see how far the fit depends on them."""
_BIAS_PX = 0.06
"""Pull of reflections beside the outline, which leaving out arcs does not show: simulated balls of
170 px were found 0.02 to 0.1 px beside their place, noise or not."""


@dataclass(frozen=True)
class Pinhole:
    """A camera without distortion: its focal length and where its axis meets the picture."""

    focal_px: float
    principal_px: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Outline:
    """The cone of rays that graze the ball.

    Attributes
    ----------
    centre_px : (float, float)
        Where the ball's centre is seen: not the middle of the ellipse.
    half_angle_rad : float
        Of the cone.
    covariance : (3, 3) float64
        Of centre x and y and the half angle, in px and rad.
    residual_px : float
        Root mean square distance of the edges that were used from the outline.
    support : float
        Share of the outline that was seen.
    """

    centre_px: tuple[float, float]
    half_angle_rad: float
    covariance: Array
    residual_px: float
    support: float


def distant_pinhole(size_px: tuple[int, int]) -> Pinhole:
    """Return a camera so far off that the outline of a ball is a circle wherever it is."""
    width, height = size_px
    return Pinhole(1e4 * max(width, height), ((width - 1) / 2, (height - 1) / 2))


def find_outline(
    picture: NDArray[np.float32],
    pinhole: Pinhole,
    hint: Array | None = None,
) -> Outline:
    """Return the outline of the ball in a linear picture (H, W, 3).

    Parameters
    ----------
    picture
        Finite and at least 0. Clipped pixels do no harm.
    pinhole
        The camera; `distant_pinhole` where its focal length is not known.
    hint : (3,) float64 or None
        Centre x, y and mean radius of the outline in pixels, to within 15 % of the radius; None to
        look for the longest round outline.

    Raises
    ------
    InputError
        If nothing round stands out, or less than a third of it, or it is too small.
    """
    rough = _search(picture, pinhole) if hint is None else hint
    if not rough[2] >= _LEAST_RADIUS_PX:
        raise InputError(
            f"the ball's radius is {rough[2]:.0f} px; below {_LEAST_RADIUS_PX:.0f} px nothing can "
            "be measured in it: go nearer or use a longer lens"
        )
    smooth = np.asarray(cv2.GaussianBlur(picture, (0, 0), _SMOOTHING_PX), np.float32)
    cone, support = _cone_near(smooth, pinhole, rough, _spoke_count(rough[2]), _TRIALS)
    if support < _LEAST_SUPPORT:
        raise InputError(
            f"only {support:.0%} of a ball's outline stands out there, {_LEAST_SUPPORT:.0%} are "
            "needed; say where the ball is with --ball x,y,radius, or choose another background"
        )
    radii_px = _spoke_radii(pinhole, cone, _spoke_count(rough[2]))
    edges = edges_near(smooth, cone[:2], radii_px, 0.02 * rough[2] + 6)
    used = np.empty(0, np.int64)
    for reach_px in (0.015 * rough[2] + 2, 2.0, 1.5, 1.5):
        used = _nearest(edges, cone_distance_px(pinhole, cone, edges.points_px), reach_px)
        if len(used) < _LEAST_SUPPORT * edges.spoke_count:
            raise InputError(
                "no edge follows the outline of the ball; say where it is with --ball x,y,radius"
            )
        cone = _solve(pinhole, edges.points_px[used], cone)
    points = edges.points_px[used]
    residual_px = float(np.sqrt(np.mean(cone_distance_px(pinhole, cone, points) ** 2)))
    _check_edges(edges, cone_distance_px(pinhole, cone, edges.points_px), residual_px)
    arcs = edges.spoke[used] * _ARCS // edges.spoke_count
    bias = np.diag([_BIAS_PX, _BIAS_PX, _BIAS_PX / pinhole.focal_px]) ** 2
    return Outline(
        (float(cone[0]), float(cone[1])),
        float(cone[2]),
        _jackknife(pinhole, points, arcs, cone) + bias,
        residual_px,
        len(used) / edges.spoke_count,
    )


def cone_distance_px(pinhole: Pinhole, cone: Array, points: Array) -> Array:
    """Return how far points (n, 2) lie outside a cone's outline, in pixels, to first order.

    `cone` is the pixel x, y of its axis and half its angle in rad.
    """
    axis = np.append((cone[:2] - pinhole.principal_px) / pinhole.focal_px, 1.0)
    axis /= np.linalg.norm(axis)
    rays, lengths = _rays(pinhole, points)
    across = np.linalg.norm(np.cross(rays, axis), axis=1)
    cosine = rays @ axis
    slope = (axis[:2] - cosine[:, None] * rays[:, :2]) / lengths[:, None]
    rad_per_px = np.linalg.norm(slope, axis=1) / np.maximum(across, 1e-300) / pinhole.focal_px
    return (np.arctan2(across, cosine) - cone[2]) / rad_per_px


def _rays(pinhole: Pinhole, points: Array) -> tuple[Array, Array]:
    """Return unit rays (n, 3) of pixels (n, 2), and their lengths (n,) before that, at z = 1."""
    at = (points - pinhole.principal_px) / pinhole.focal_px
    rays = np.concatenate([at, np.ones((len(at), 1))], axis=1)
    lengths = np.linalg.norm(rays, axis=1)
    return rays / lengths[:, None], lengths


def _solve(pinhole: Pinhole, points: Array, start: Array) -> Array:
    # Far outliers cost as their logarithm: edges of reflections that run beside the outline.
    return least_squares(
        lambda cone: cone_distance_px(pinhole, cone, points),
        start,
        x_scale=np.array([1.0, 1.0, 1.0 / pinhole.focal_px]),
        loss="cauchy",
        f_scale=_OUTLIER_PX,
    ).x


def _nearest(edges: Edges, distance_px: Array, reach_px: float) -> NDArray[np.int64]:
    """Return the edge of each spoke that is nearest to the outline, where one is within reach."""
    order = np.lexsort((np.abs(distance_px), edges.spoke))
    order = order[np.abs(distance_px[order]) <= reach_px]
    _, first = np.unique(edges.spoke[order], return_index=True)
    return order[first]


def _check_edges(edges: Edges, distance_px: Array, residual_px: float) -> None:
    """Raise InputError if edges scatter, or lie as densely beside the outline as on it."""
    on, *beside = (len(_nearest(edges, distance_px - shift, 1.0)) for shift in (0.0, *_BESIDE_PX))
    if residual_px > _MOST_RESIDUAL_PX or on < _LEAST_CONCENTRATION * np.mean(beside):
        raise InputError(
            f"no sharp outline: edges scatter by {residual_px:.2f} px, {on} lie on the outline and "
            f"{np.mean(beside):.0f} beside it. The picture is blurred, or the "
            "background is like what the ball mirrors, or --focal-px is missing for a ball away "
            "from the picture's middle; photograph it sharp, before a plain background"
        )


def _jackknife(pinhole: Pinhole, points: Array, arcs: NDArray[np.int64], cone: Array) -> Array:
    """Return the covariance (3, 3) from leaving out an arc at a time, each by one Newton step.

    Neighbouring edges err together, and residuals alone would promise too much; arcs hardly do.
    """
    steps = np.diag([1e-3, 1e-3, 1e-3 / pinhole.focal_px])
    slopes = np.stack(
        [
            cone_distance_px(pinhole, cone + step, points)
            - cone_distance_px(pinhole, cone - step, points)
            for step in steps
        ],
        axis=1,
    ) / (2 * np.diag(steps))
    distance = cone_distance_px(pinhole, cone, points)
    weights = 1.0 / (1.0 + (distance / _OUTLIER_PX) ** 2)
    scale = np.diag(steps) / 1e-3  # pixels and radians differ by the focal length
    slopes *= scale
    present = np.unique(arcs)
    moved = []
    for arc in present:
        kept = arcs != arc
        weighted = slopes[kept] * weights[kept, None]
        moved.append(np.linalg.solve(weighted.T @ slopes[kept], weighted.T @ distance[kept]))
    deviations = (np.array(moved) - np.mean(moved, axis=0)) * scale
    return deviations.T @ deviations * (len(present) - 1) / len(present)


def _search(picture: NDArray[np.float32], pinhole: Pinhole) -> Array:
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
        cone, support = _cone_near(smooth, small, rough, count, _SEARCH_TRIALS)
        length = support**2 * rough[2]
        if support >= _LEAST_SUPPORT and length > best_length:
            radius = _spoke_radii(small, cone, 64).mean()
            best, best_length = np.append(cone[:2], radius), length
    if best is None:
        raise InputError("no ball found in the picture; say where it is with --ball x,y,radius")
    return np.append((best[:2] + 0.5) / scale - 0.5, best[2] / scale)


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


def _cone_near(
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
    rays, _ = _rays(pinhole, edges.points_px)
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


def _spoke_count(radius_px: float) -> int:
    return int(np.clip(2 * np.pi * radius_px / _SPOKE_SPACING_PX, 64, _MOST_SPOKES))


def _spoke_radii(pinhole: Pinhole, cone: Array, count: int) -> Array:
    """Return the radii (count,) of a cone's outline about the pixel of its axis."""
    outward = spoke_directions(count)
    radii = np.full(count, pinhole.focal_px * np.tan(cone[2]))
    for _ in range(6):  # each step errs by the share by which the outline is not a circle
        radii -= cone_distance_px(pinhole, cone, cone[:2] + radii[:, None] * outward)
    return radii
