"""The sun found in a picture of the sky, to a fraction of a pixel.

Input  : brightness (H, W), counts up to a level at which they clip.
Output : the middle of the sun, or why it cannot be had.
Method : a clipped sun is a plateau with soft shoulders of glare. What rises above half of their
height is weighed by how far it rises, plateau included: pixels at the edge count by their share.
Domain : the sun may be clipped, but its glare must fall off on all sides inside the picture.
Fails  : through thin cloud whose brightness grades evenly the middle moves with the cloud, by up to
a quarter of the glare's radius; and where something other than the sun is the brightest.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

_CORE = 0.9
"""Share of the highest level from which on a pixel may be the sun's."""

_LARGEST_SHARE = 0.02
"""Of the picture's seen area: a disc of 11° radius in a hemisphere."""

_CANDIDATES = 8
"""Brightest patches that are looked at, largest first: clouds may be brighter and larger."""

_RIVAL_SHARE = 0.3
"""Of the area: smaller ones are reflections in the lens."""

_LEAST_ROUNDNESS = 0.75
"""Share of a patch inside the circle of its area about its middle: 0.91 of a square, 0.8 of an
ellipse twice as long as wide; rays that the aperture's blades make take little from it."""

_LEAST_RISE = 0.15
_LARGEST_SHIFT = 0.25
"""Between the middle of the plateau and that of the glare, as a share of the glare's radius."""

_FEW_PIXELS = 12
"""Fewer have no shape."""


@dataclass(frozen=True)
class SunDisc:
    """The middle of the sun in a picture, and the radius of the glare it was found from."""

    centre_px: tuple[float, float]
    radius_px: float


@dataclass(frozen=True)
class NoSun:
    """Why a picture does not show where the sun stands."""

    reason: str


def find_sun(
    brightness: NDArray[np.float32], full: float, seen: NDArray[np.bool_]
) -> SunDisc | NoSun:
    """Return the sun's disc in a picture.

    Parameters
    ----------
    brightness : (H, W) float32
        Of the channel with the least counts: the sun and clouds fill all three, blue sky does not.
    full : float
        Count from which on a pixel is clipped.
    seen : (H, W) bool
        Where the lens shows directions that are known.
    """
    level = np.where(seen & (brightness > 0), np.minimum(brightness, full), 0).astype(np.float32)
    top = float(level.max())
    if top <= 0:
        return NoSun("the picture is black")
    _, labels, stats, centroids = cv2.connectedComponentsWithStats(
        (level >= _CORE * top).astype(np.uint8), connectivity=8
    )
    areas = stats[:, cv2.CC_STAT_AREA]
    largest_first = _separate(1 + np.argsort(-areas[1:], kind="stable"), areas, centroids)
    if areas[largest_first[0]] > _LARGEST_SHARE * np.count_nonzero(seen):
        return NoSun("what is brightest is too large for the sun: cloud, or exposed too long")
    judged = [(_disc(level, seen, top, labels, core), areas[core]) for core in largest_first]
    suns = [(disc, area) for disc, area in judged if isinstance(disc, SunDisc)]
    if not suns:
        return judged[0][0]
    if len(suns) > 1 and suns[1][1] > max(_RIVAL_SHARE * suns[0][1], _FEW_PIXELS):
        return NoSun("two bright patches could be the sun")
    return suns[0][0]


def _separate(cores: NDArray[np.intp], areas: MatLike, centroids: MatLike) -> list[int]:
    """Return the first of `cores`, largest first, without those in the glare of a larger one."""
    separate: list[int] = []
    for core in map(int, cores[: 4 * _CANDIDATES]):
        away = np.linalg.norm(centroids[separate] - centroids[core], axis=-1)
        if np.all(away > _reach(areas[separate])):
            separate.append(core)
    return separate[:_CANDIDATES]


def _reach(area: MatLike | int) -> NDArray[np.float64]:
    """Return how far, in pixels, the glare of bright patches is looked at."""
    return np.asarray(np.ceil(4 * np.sqrt(np.divide(area, np.pi)) + 6))


def _disc(
    level: NDArray[np.float32],
    seen: NDArray[np.bool_],
    top: float,
    labels: MatLike,
    core: int,
) -> SunDisc | NoSun:
    """Return the disc about one of the brightest patches, from all that rises above half of it."""
    rows, columns = np.nonzero(labels == core)
    x, y = columns.mean(), rows.mean()
    area = len(rows)
    reach = int(_reach(area))
    left, upper = max(round(x) - reach, 0), max(round(y) - reach, 0)
    window = (slice(upper, round(y) + reach + 1), slice(left, round(x) + reach + 1))
    near_rows, near_columns = np.indices(level[window].shape)
    distance = np.hypot(near_columns + left - x, near_rows + upper - y)
    if np.count_nonzero(seen[window] & (distance <= reach / 2)) < 0.7 * reach**2:
        return NoSun("it is cut off by the rim of what the lens shows")
    round_part = np.count_nonzero(np.hypot(columns - x, rows - y) <= np.sqrt(area / np.pi))
    if area >= _FEW_PIXELS and round_part < _LEAST_ROUNDNESS * area:
        return NoSun("what is brightest is not round: cloud")
    near = level[window].astype(np.float64)
    inside = distance <= reach
    surroundings = float(np.median(near[inside & (distance > 0.75 * reach) & seen[window]]))
    if top - surroundings < _LEAST_RISE * top:
        return NoSun("it does not stand out from its surroundings: cloud")
    half = (top + surroundings) / 2
    _, parts = cv2.connectedComponents((near > half).astype(np.uint8), connectivity=8)
    glare = parts == parts[rows[0] - upper, columns[0] - left]
    if np.any(glare & ~inside):
        return NoSun("its glare runs into a bright cloud")
    weight = np.where(glare, near - half, 0.0) / np.sum(near[glare] - half)
    centre_x = float(np.sum(weight * near_columns)) + left
    centre_y = float(np.sum(weight * near_rows)) + upper
    radius = float(np.sqrt(np.count_nonzero(glare) / np.pi))
    if np.hypot(centre_x - x, centre_y - y) > _LARGEST_SHIFT * radius + 0.5:
        return NoSun("its glare is lopsided: cloud before it")
    return SunDisc((centre_x, centre_y), radius)
