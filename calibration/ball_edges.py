"""Edges along spokes: where the outline of a ball may cross each of them.

Input  : a linear picture, and a closed curve near the outline.
Output : for every spoke the points at which the radiance changes fastest, to a fraction of a pixel.
The picture must be linear: a pixel that the ball half covers then holds the mean of both sides, and
the place of the steepest change is the outline's. In gamma-coded counts it is shifted.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

_STEP_PX = 0.5
_LEAST_CONTRAST = 0.04
"""Change over a pixel, relative to the radiance along the spoke, from which on it is an edge."""
_ALONG_PX = 13.0
"""Arc that changes are averaged over: those of an outline are alike, those of noise are not."""
_FLOOR = 0.02
"""Share of the median radiance that is added to it: contrast in the dark is noise."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Where spokes cross edges.

    Attributes
    ----------
    points_px : (E, 2) float64
    spoke : (E,) int64
        Which spoke, in the order of the azimuth, a point lies on.
    spoke_count : int
        All spokes, also those that leave the picture.
    """

    points_px: NDArray[np.float64]
    spoke: NDArray[np.int64]
    spoke_count: int


def edges_near(
    picture: NDArray[np.float32],
    centre_px: NDArray[np.float64],
    radii_px: NDArray[np.float64],
    reach_px: float,
) -> Edges:
    """Return the edges of a linear picture (H, W, 3) up to `reach_px` from a curve.

    The curve is given by its radii (S,) about `centre_px` (2,) at azimuths evenly spaced from +x
    toward +y, a spoke each. An edge is where a colour changes by more than 4 % a pixel, and faster
    than on either side along the spoke. The picture should be smoothed by most of a pixel.
    """
    outward = spoke_directions(len(radii_px))
    steps = int(np.ceil(reach_px / _STEP_PX))
    offsets = _STEP_PX * np.arange(-steps, steps + 1)
    points = centre_px + (radii_px[:, None] + offsets)[..., None] * outward[:, None, :]
    x, y = np.moveaxis(points, -1, 0).astype(np.float32)
    # Spokes that leave the picture meet no edge there: its border is repeated.
    sampled = np.asarray(
        cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.float64
    )
    height, width = picture.shape[:2]
    inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)

    floor = _FLOOR * float(np.median(picture)) + 1e-12
    slope = (sampled[:, 2:] - sampled[:, :-2]) / (2 * _STEP_PX)
    brightness = np.linalg.norm(sampled, axis=-1).mean(axis=1)  # a lamp must not outshine an arc
    slope /= brightness[:, None, None] + floor
    along = round(_ALONG_PX * len(radii_px) / (2 * np.pi * radii_px.mean()))
    slope = uniform_filter1d(slope, max(along, 1), axis=0, mode="wrap")
    steepness = np.linalg.norm(slope, axis=-1)
    steepness[~(inside[:, 2:] & inside[:, :-2])] = 0.0
    before, here, after = steepness[:, :-2], steepness[:, 1:-1], steepness[:, 2:]
    is_edge = (here > before) & (here >= after) & (before > 0) & (after > 0)
    is_edge &= here > _LEAST_CONTRAST

    spoke, place = np.nonzero(is_edge)
    low, middle, high = before[is_edge], here[is_edge], after[is_edge]
    summit = 0.5 * (low - high) / (low - 2 * middle + high)  # of the parabola through the three
    radius = radii_px[spoke] + offsets[place + 2] + _STEP_PX * summit
    return Edges(centre_px + radius[:, None] * outward[spoke], spoke, len(radii_px))


def spoke_directions(count: int) -> NDArray[np.float64]:
    """Return unit vectors (count, 2) in the picture, from +x toward +y."""
    azimuth = 2 * np.pi * np.arange(count) / count
    return np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
