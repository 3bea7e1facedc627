"""Corners to a hundredth of a pixel, and how far off each may be.

Input  : grey counts, corners to a pixel or two, and how far around each no other edge begins.
Output : corners, their standard deviation, and which of them are corners at all.
A corner is fitted as two blurred edges that cross. Each may bend, because a lens bends straight
edges, and a fit of straight ones moves toward the inside of the bend; the light may fall off, and
what is white may be clipped, so that dark squares look too small to touch.
Cost   : 1 ms a corner with a window of 25 × 25 pixels.
Fails  : where an edge's bend changes within the window; where noise is not white (strong JPEG
         compression), sigma is too small.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Array = NDArray[np.float64]

_WHITE = 255.0

_BLUR = 6
"""Place of the blur's logarithm in the state of a fit, which `_crossing` explains."""

_STEPS = 30

_SETTLED_PX = 1e-4

_FARTHEST_PX = 14.0
"""Half the side of the largest window: more pixels hardly help, and bends change."""

_LEAST_PX = 2.5

_FLOOR_PX = 0.005
"""What no window is better than: the lens's blur is not Gaussian, nor even on both sides."""

_LARGEST_PX = 0.25
"""Standard deviation of what is no longer a measurement."""

_FIRST_BLUR_PX = 0.8

_LEAST_EXPLAINED = 0.8
"""Share of the window's variance that two crossing edges explain; texture has less."""


def refine_corners(
    grey: NDArray[np.uint8], corners_px: Array, reach_px: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return corners (n, 2), their standard deviation (n,), and whether each was found (n,).

    Parameters
    ----------
    grey : (H, W) uint8
    corners_px : (n, 2)
        Where they are to within half the reach, a pixel or two at most.
    reach_px : (n,)
        Radius around each within which only its own edges lie.
    """
    radius = np.clip(reach_px, _LEAST_PX, _FARTHEST_PX)
    offsets, values, weights = _windows(grey, corners_px, radius)
    state = _first_guess(offsets, values, weights)
    damping = np.full(len(state), 1e-3)
    predicted, jacobian = _crossing(state, offsets)
    cost = np.sum(weights * (values - predicted) ** 2, axis=1)
    active = np.ones(len(state), np.bool_)
    for _ in range(_STEPS):
        normal, gradient = _normal_equations(jacobian, weights, values - predicted)
        diagonal = np.einsum("nii->ni", normal)
        diagonal *= 1 + damping[:, None]
        diagonal += 1e-9
        step = np.linalg.solve(normal, gradient[..., None])[..., 0]
        step[~active] = 0
        step[:, :2] = np.clip(step[:, :2], -1.0, 1.0)
        trial = state + step
        trial[:, _BLUR] = np.clip(trial[:, _BLUR], np.log(0.3), np.log(4.0))
        trial_predicted, trial_jacobian = _crossing(trial, offsets)
        trial_cost = np.sum(weights * (values - trial_predicted) ** 2, axis=1)
        better = trial_cost <= cost
        state[better], cost[better] = trial[better], trial_cost[better]
        predicted[better], jacobian[better] = trial_predicted[better], trial_jacobian[better]
        damping = np.where(better, damping / 5, damping * 10)
        active &= ~(better & (np.abs(step[:, :2]).max(axis=1) < _SETTLED_PX)) & (damping < 1e8)
        if not np.any(active):
            break
    residual = values - predicted
    sigma = _standard_deviation(jacobian, weights, residual)
    mean = np.sum(weights * values, axis=1) / np.sum(weights, axis=1)
    spread = np.sum(weights * (values - mean[:, None]) ** 2, axis=1)
    found = (cost < (1 - _LEAST_EXPLAINED) * spread) & (sigma < _LARGEST_PX)
    found &= np.hypot(state[:, 0], state[:, 1]) < np.maximum(radius / 2, 1.5)
    found &= np.abs(np.sin(state[:, 2] - state[:, 3])) > 0.2
    return corners_px + state[:, :2], sigma, found


def _windows(
    grey: NDArray[np.uint8], corners_px: Array, radius: Array
) -> tuple[Array, Array, Array]:
    """Return offsets (n, K, 2) from each corner, counts (n, K) and weights (n, K) around it.

    The weight fades toward the radius, so that the fit does not depend on where a pixel's edge
    lies, and is 0 outside the picture.
    """
    half = int(np.ceil(radius.max()))
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    grid = np.stack([x.ravel(), y.ravel()], axis=-1)
    pixels = np.rint(corners_px).astype(np.int64)[:, None] + grid
    height, width = grey.shape
    inside = np.all((pixels >= 0) & (pixels < [width, height]), axis=-1)
    pixels = np.clip(pixels, 0, [width - 1, height - 1])
    values = grey[pixels[..., 1], pixels[..., 0]].astype(np.float64)
    offsets = pixels - corners_px[:, None]
    share = np.sum(offsets**2, axis=-1) / (radius[:, None] + 0.5) ** 2
    weights = np.where(inside, np.clip(1.0 - share, 0.0, 1.0), 0.0)
    return offsets, values, weights


def _first_guess(offsets: Array, values: Array, weights: Array) -> Array:
    """Return the state (n, 11) of straight edges through the window's middle.

    Around a corner the counts go as the sine of twice the angle, on a plane; of a quadratic fitted
    to them the saddle's two level lines are the edges.
    """
    x, y = offsets[..., 0], offsets[..., 1]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    normal = np.einsum("nki,nk,nkj->nij", terms, weights, terms) + 1e-9 * np.eye(6)
    right = np.einsum("nki,nk,nk->ni", terms, weights, values)
    fit = np.linalg.solve(normal, right[..., None])[..., 0]
    _, _, _, a, b, c = fit.T
    # a x² + b x y + c y² = 0 along (cos θ, sin θ): (a+c)/2 + (a−c)/2 cos 2θ + b/2 sin 2θ = 0.
    size = np.maximum(np.hypot(a - c, b), 1e-9)
    middle = np.arctan2(b, a - c)
    opening = np.arccos(np.clip(-(a + c) / size, -0.9, 0.9))
    mean = np.sum(weights * values, axis=1) / np.sum(weights, axis=1)
    spread = np.sqrt(np.sum(weights * (values - mean[:, None]) ** 2, axis=1) / weights.sum(axis=1))
    state = np.zeros((len(values), 11))
    state[:, 2], state[:, 3] = (middle + opening) / 2, (middle - opening) / 2
    state[:, _BLUR] = np.log(_FIRST_BLUR_PX)
    state[:, 7] = mean
    # Between the edges, along middle / 2, the quadratic is positive, and so is the product of the
    # signed distances there if it is negative for these normals: the contrast takes the sign.
    state[:, 8] = -spread * np.sign(np.sin(opening))
    return state


def _crossing(state: Array, offsets: Array) -> tuple[Array, Array]:
    """Return counts (n, K) of two blurred edges that cross, and their derivatives (n, K, 11).

    The state is the corner x, y; each edge's angle; each edge's bend in 1/px; the logarithm of the
    blur; the mean, the contrast, and the slope of the mean in x and y.
    """
    x, y, _, _, _, _, log_blur, mean, contrast, slope_x, slope_y = (
        each[:, None] for each in state.T
    )
    dx, dy = offsets[..., 0] - x, offsets[..., 1] - y
    jacobian = np.empty((*dx.shape, 11))
    sides, densities, by_corner = [], [], []
    scale = np.exp(-log_blur) / np.sqrt(2.0)
    for edge in (0, 1):
        cosine, sine = np.cos(state[:, 2 + edge, None]), np.sin(state[:, 2 + edge, None])
        bend = state[:, 4 + edge, None]
        along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
        distance = across + bend / 2 * along**2
        sides.append(erf(distance * scale))
        densities.append(2 / np.sqrt(np.pi) * scale * np.exp(-((distance * scale) ** 2)))
        by_corner.append(
            (
                sine - bend * along * cosine,
                -cosine - bend * along * sine,
                -along + bend * along * across,
                along**2 / 2,
                -distance,
            )
        )
    lifted = [contrast * densities[0] * sides[1], contrast * densities[1] * sides[0]]
    for column in (0, 1):
        jacobian[..., column] = sum(lifted[edge] * by_corner[edge][column] for edge in (0, 1))
    jacobian[..., 0] -= slope_x
    jacobian[..., 1] -= slope_y
    for edge in (0, 1):
        jacobian[..., 2 + edge] = lifted[edge] * by_corner[edge][2]
        jacobian[..., 4 + edge] = lifted[edge] * by_corner[edge][3]
    jacobian[..., _BLUR] = sum(lifted[edge] * by_corner[edge][4] for edge in (0, 1))
    jacobian[..., 7] = 1.0
    jacobian[..., 8] = sides[0] * sides[1]
    jacobian[..., 9], jacobian[..., 10] = dx, dy
    counts = mean + contrast * sides[0] * sides[1] + slope_x * dx + slope_y * dy
    white = counts > _WHITE
    counts[white], jacobian[white] = _WHITE, 0.0
    return counts, jacobian


def _normal_equations(jacobian: Array, weights: Array, residual: Array) -> tuple[Array, Array]:
    weighted = jacobian * weights[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ jacobian
    return normal, np.einsum("nki,nk->ni", weighted, residual)


def _standard_deviation(jacobian: Array, weights: Array, residual: Array) -> Array:
    """Return the standard deviation (n,) of a corner's coordinate, the mean over both."""
    weighted = jacobian * weights[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ jacobian
    inverse = np.linalg.pinv(normal, hermitian=True)
    freedom = np.maximum(np.sum(weights, axis=1) - 11 * weights.max(axis=1), 1.0)
    variance = np.sum(weights * residual**2, axis=1) / freedom
    spread = inverse @ (np.swapaxes(weighted, 1, 2) @ weighted) @ inverse
    both = (spread[:, 0, 0] + spread[:, 1, 1]) / 2 * variance
    return np.asarray(np.sqrt(both + _FLOOR_PX**2))
