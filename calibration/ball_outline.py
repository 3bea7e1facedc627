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

from calibration.ball_cone import Pinhole, cone_distance_px, spoke_radii
from calibration.ball_edges import Edges, edges_near, spoke_directions
from calibration.ball_search import LEAST_SUPPORT, cone_near, search_ball
from capture.errors import InputError

Array = NDArray[np.float64]

_LEAST_RADIUS_PX = 20.0
_TRIALS = 500
_SMOOTHING_PX = 0.5
"""Enough against noise; more lets reflections beside the outline pull at it."""
_SPOKE_SPACING_PX = 1.5
_MOST_SPOKES = 1440
_OUTLIER_PX = 0.25
"""Distance from which on an edge counts less."""
_MOST_RESIDUAL_PX = 0.5
"""Of a sharp outline it is 0.04 to 0.35 px; edges by chance have 0.7 and more."""
_BESIDE_PX = (-5.0, -3.5, 3.5, 5.0)
_LEAST_CONCENTRATION = 1.7
"""How many more spokes must have an edge on the outline, within a pixel, than 3.5 to 5 px beside
it. In noise there are 1.3 times as many where there are most."""
_MARKED_POINTS = 64
_ARCS = 24
"""Parts of the outline that are left out in turn to see how far the fit depends on them."""
_BIAS_PX = 0.06
"""Pull of reflections beside the outline, which leaving out arcs does not show: simulated balls of
170 px were found 0.02 to 0.1 px beside their place, noise or not."""


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
        Share of the outline that was seen: 0 if it was marked by hand.
    """

    centre_px: tuple[float, float]
    half_angle_rad: float
    covariance: Array
    residual_px: float
    support: float


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
    rough = search_ball(picture, pinhole) if hint is None else hint
    _check_radius(rough[2])
    smooth = np.asarray(cv2.GaussianBlur(picture, (0, 0), _SMOOTHING_PX), np.float32)
    cone, support = cone_near(smooth, pinhole, rough, _spoke_count(rough[2]), _TRIALS)
    if support < LEAST_SUPPORT:
        raise InputError(
            f"only {support:.0%} of a ball's outline stands out there, {LEAST_SUPPORT:.0%} are "
            "needed; say where the ball is with --ball x,y,radius, or choose another background"
        )
    radii_px = spoke_radii(pinhole, cone, _spoke_count(rough[2]))
    edges = edges_near(smooth, cone[:2], radii_px, 0.02 * rough[2] + 6)
    used = np.empty(0, np.int64)
    for reach_px in (0.015 * rough[2] + 2, 2.0, 1.5, 1.5):
        used = _nearest(edges, cone_distance_px(pinhole, cone, edges.points_px), reach_px)
        if len(used) < LEAST_SUPPORT * edges.spoke_count:
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


def marked_outline(circle: Array, sigma_px: float, pinhole: Pinhole) -> Outline:
    """Return the outline nearest to a circle (3,), x, y and radius, that was marked by hand.

    `sigma_px` is the standard deviation of each of the three.

    Raises
    ------
    InputError
        If the circle is too small, or `sigma_px` is not positive.
    """
    _check_radius(circle[2])
    if not sigma_px > 0:
        raise InputError(f"a mark by hand is off by some of a pixel at least, got ±{sigma_px:g} px")
    points = circle[:2] + circle[2] * spoke_directions(_MARKED_POINTS)
    start = np.append(circle[:2], np.arctan(circle[2] / pinhole.focal_px))
    cone = _solve(pinhole, points, start)
    return Outline(
        (float(cone[0]), float(cone[1])),
        float(cone[2]),
        np.diag([sigma_px, sigma_px, sigma_px / pinhole.focal_px]) ** 2,
        float(np.sqrt(np.mean(cone_distance_px(pinhole, cone, points) ** 2))),
        0.0,
    )


def _check_radius(radius_px: float) -> None:
    if not radius_px >= _LEAST_RADIUS_PX:
        raise InputError(
            f"the ball's radius is {radius_px:.0f} px; below {_LEAST_RADIUS_PX:.0f} px nothing can "
            "be measured in it: go nearer or use a longer lens"
        )


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
            "from the picture's middle; photograph it sharp, before a plain background, or mark it "
            "with --ball and --marked-px"
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


def _spoke_count(radius_px: float) -> int:
    return int(np.clip(2 * np.pi * radius_px / _SPOKE_SPACING_PX, 64, _MOST_SPOKES))
