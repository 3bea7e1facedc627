"""ꟻLIP: how different two pictures look when they are shown in turn, from 0 to 1 in every pixel.

Colours are compared as they remain after the eye's blur at a distance, edges and points as they
stand out; a difference in these makes one in colour count for more [1]_. Pictures of radiance are
compared at the exposures between which a viewer might choose, and a pixel has its greatest
difference [2]_.

Input  : pictures of linear Rec.709 values, of one size.    Output : (H, W) float32.
Cost   : about 60 ms of CPU time for a pair of 640×480 pixels at one exposure.
Fails  : for a viewer who is nearer or farther than supposed (PIXELS_PER_DEGREE).

References
----------
.. [1] P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, "FLIP:
       A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech.
       3(2), 2020.
.. [2] P. Andersson, J. Nilsson, P. Shirley, T. Akenine-Möller, "Visualizing Errors in Rendered High
       Dynamic Range Images", Eurographics Short Papers, 2021.
"""

import math

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.maps.environment import luminance

Floats = NDArray[np.float32]

PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * math.pi / 180
"""Of a display 0.7 m and 3840 pixels wide, 0.7 m away."""

# Weights and widths (in square degrees) of the Gaussians that the eye blurs brightness, red against
# green, and blue against yellow by.
_BLUR = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
_EDGE_DEG = 0.082  # from peak to trough of the eye's detector of edges
_COLOUR_EXPONENT, _FEATURE_EXPONENT = 0.7, 0.5
_KNEE_AT, _KNEE = 0.4, 0.95  # differences up to 0.4 of the largest take up 95 % of the scale

# Exact sRGB primaries and white point D65; its rows sum to the white.
_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
_RELATIVE_XYZ = (_XYZ / _XYZ.sum(axis=1, keepdims=True)).astype(np.float32)
_OPPONENT = np.array([[0.0, 116, 0], [500, -500, 0], [0, 200, -200]], np.float32)
_OFFSET = np.array([-16.0, 0, 0], np.float32)

# The tone curve (a x² + b x) / (c x² + d x + e) of [2]: K. Narkowicz's fit of ACES.
_TONES = (0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14)
_BRIGHT = 0.85


def flip(
    test: ArrayLike, reference: ArrayLike, pixels_per_degree: float = PIXELS_PER_DEGREE
) -> Floats:
    """Return how different two displayed pictures look, (H, W); the same either way round.

    Parameters
    ----------
    test, reference : (H, W, 3)
        Linear values in [0, 1], as the display shows them.
    pixels_per_degree : float
        How fine the display is to its viewer.
    """
    ours, truth = (
        _seen(np.asarray(each, np.float32), pixels_per_degree) for each in (test, reference)
    )
    return _difference(ours, truth)


def hdr_flip(
    test: ArrayLike, reference: ArrayLike, pixels_per_degree: float = PIXELS_PER_DEGREE
) -> Floats:
    """Return how different two pictures of radiance look at most, (H, W), exposed alike.

    Parameters
    ----------
    test, reference : (H, W, 3)
        Radiance, at least 0. The reference alone decides between which exposures: from where its
        brightest pixel is bright to where its median is.
    """
    ours, truth = (np.asarray(each, np.float32) for each in (test, reference))
    worst = np.zeros(truth.shape[:2], np.float32)
    for stops in exposures(truth):
        scale = np.float32(2**stops)
        shown = flip(_toned(scale * ours), _toned(scale * truth), pixels_per_degree)
        np.maximum(worst, shown, out=worst)
    return worst


def exposures(reference: Floats) -> NDArray[np.float64]:
    """Return the exposures in stops, at most one apart, that `hdr_flip` compares at.

    Black pixels have no part in the median: where they are the half of a picture there would be no
    end to the exposures.
    """
    lit = luminance(reference)
    lit = lit[lit > 0]
    if len(lit) == 0:
        return np.zeros(1)
    a, b, c, d, e = _TONES
    bright = np.roots([a - _BRIGHT * c, b - _BRIGHT * d, -_BRIGHT * e]).max()
    first, last = np.log2(bright / lit.max()), np.log2(bright / np.median(lit))
    return np.linspace(first, last, max(2, math.ceil(last - first)))


def _toned(radiance: Floats) -> Floats:
    a, b, c, d, e = _TONES
    x = np.minimum(radiance, np.float32(1e6))  # beyond it the curve is flat, and x² may overflow
    return np.clip((a * x + b) * x / ((c * x + d) * x + e), 0, 1)


def _seen(picture: Floats, pixels_per_degree: float) -> tuple[Floats, Floats]:
    """Return a picture's colours as perceived (H, W, 3), and its edges and points (H, W, 2)."""
    opponent = picture @ (_OPPONENT @ _RELATIVE_XYZ).T + _OFFSET
    blurred = np.stack(
        [
            _blurred(opponent[..., channel], gaussians, pixels_per_degree)
            for channel, gaussians in enumerate(_BLUR)
        ],
        axis=-1,
    )
    to_linear = np.linalg.inv(_OPPONENT @ _RELATIVE_XYZ).T
    linear = np.clip((blurred - _OFFSET) @ to_linear, 0, 1)
    brightness = (opponent[..., 0] + 16) / 116
    return _perceived(linear), _features(brightness, pixels_per_degree)


def _difference(ours: tuple[Floats, Floats], truth: tuple[Floats, Floats]) -> Floats:
    colour = _redistributed(_distance(ours[0], truth[0]) ** _COLOUR_EXPONENT)
    feature = np.abs(ours[1] - truth[1]).max(axis=-1) / math.sqrt(2)
    return colour ** (1 - feature**_FEATURE_EXPONENT)


def _blurred(
    channel: Floats, gaussians: tuple[tuple[float, float], ...], pixels_per_degree: float
) -> Floats:
    """Return a channel behind a sum of Gaussians, each weight · √(π/b) · exp(−π² r² / b)."""
    widest = max(width for each in _BLUR for _, width in each)
    radius = math.ceil(3 * math.sqrt(widest / (2 * math.pi**2)) * pixels_per_degree)
    squares = (np.arange(-radius, radius + 1) / pixels_per_degree) ** 2
    blurred, total = np.zeros_like(channel), 0.0
    for weight, width in gaussians:
        line = np.exp(-(math.pi**2) * squares / width)
        share = weight * math.sqrt(math.pi / width) * float(line.sum()) ** 2
        line /= line.sum()
        blurred += share * _filtered(channel, line, line)
        total += share
    return blurred / total


def _features(brightness: Floats, pixels_per_degree: float) -> Floats:
    """Return how strongly edges and points stand out, (H, W, 2)."""
    sigma_px = 0.5 * _EDGE_DEG * pixels_per_degree
    radius = math.ceil(3 * sigma_px)
    x = np.arange(-radius, radius + 1)
    bell = np.exp(-(x**2) / (2 * sigma_px**2))
    found = []
    for line in (-x * bell, (x**2 / sigma_px**2 - 1) * bell):
        # What is above 0 sums to 1, what is below to −1.
        balanced = np.where(line > 0, line / line[line > 0].sum(), -line / line[line < 0].sum())
        across = _filtered(brightness, balanced, bell / bell.sum())
        down = _filtered(brightness, bell / bell.sum(), balanced)
        found.append(np.hypot(across, down))
    return np.stack(found, axis=-1)


def _filtered(channel: Floats, across: NDArray[np.float64], down: NDArray[np.float64]) -> Floats:
    filtered = cv2.sepFilter2D(
        np.ascontiguousarray(channel), cv2.CV_32F, across, down, borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(filtered, np.float32)


def _perceived(linear: Floats) -> Floats:
    """Return L*a*b* with colours that fade in the dark, as Hunt found."""
    relative = linear @ _RELATIVE_XYZ.T
    delta = 6 / 29
    root = np.where(relative > delta**3, np.cbrt(relative), relative / (3 * delta**2) + 4 / 29)
    lab: Floats = root @ _OPPONENT.T + _OFFSET
    lab[..., 1:] *= 0.01 * lab[..., :1]
    return lab


def _distance(one: Floats, other: Floats) -> Floats:
    """Return how far apart colours are: along L* plus across it."""
    apart = one - other
    distance: Floats = np.abs(apart[..., 0]) + np.hypot(apart[..., 1], apart[..., 2])
    return distance


_GREEN_TO_BLUE = _distance(*_perceived(np.array([[0, 1, 0], [0, 0, 1]], np.float32)))
_LARGEST = float(_GREEN_TO_BLUE) ** _COLOUR_EXPONENT
"""Between green and blue, the most different of the displayed colours."""


def _redistributed(distance: Floats) -> Floats:
    """Return distances up to the largest in [0, 1], the small ones spread out."""
    knee = _KNEE_AT * _LARGEST
    above = (distance - knee) / (_LARGEST - knee)
    return np.where(distance < knee, _KNEE / knee * distance, _KNEE + (1 - _KNEE) * above)
