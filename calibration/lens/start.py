"""A first lens and board poses from nothing but the corners: many starts, the best one kept.

Domain : lenses with an axis of symmetry somewhere near the picture's centre, 40° to 250° wide.
Cost   : about 0.5 s for 20 views: every hypothesis is judged by one linear solve a view.
Fails  : where no hypothesis explains most views: the corners are numbered wrongly, or too few.
"""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calibration.lens.adjust import Adjusted, Free, Solution, adjust, typical_px
from calibration.lens.corners import Corners
from calibration.lens.poses import poses_from_directions
from calibration.models.kannala_brandt import KannalaBrandt

Array = NDArray[np.float64]

_RIM_ANGLES_DEG = (20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 125)
"""Supposed angles of the corner farthest from the centre."""

_CENTRE_OFFSETS = (0.0, -0.15, 0.15)
"""Supposed places of the axis, off the picture's centre, in widths and heights."""

_PROFILES = ((0.0, 0.0), (-1.0 / 24.0, 1.0 / 1920.0), (1.0 / 12.0, 1.0 / 120.0))
"""k1 and k2 of the equidistant, equisolid and stereographic lens."""

_TRIED = 4
"""How many of the best hypotheses are adjusted."""

_SOFT_PX = (20.0, 2.0)
"""Scales of the loss of the first adjustment, with the profile held, and of the second."""

FREE = Free(np.ones(8, np.bool_))
"""All parameters of the lens that is returned, of a flat board."""

_FREE_FIRST = Free(np.array([True] * 4 + [False] * 4))


def first_solution(corners: Corners, size_px: tuple[int, int]) -> Adjusted:
    """Return the best of several adjusted Kannala-Brandt lenses, with fx and fy apart."""
    ranked = sorted(hypotheses(corners, size_px), key=lambda each: each[0])
    tried = [_adjusted(corners, model) for _, model in ranked[:_TRIED]]
    return min(tried, key=lambda each: typical_px(each.residuals_px))


def hypotheses(corners: Corners, size_px: tuple[int, int]) -> Iterator[tuple[float, KannalaBrandt]]:
    """Yield lenses, each after about how far in pixels it misses the corners."""
    size = np.array(size_px, np.float64)
    for offset in itertools.product(_CENTRE_OFFSETS, _CENTRE_OFFSETS):
        x, y = (size - 1.0) / 2.0 + np.array(offset) * size
        rim_px = float(np.hypot(*(corners.pixels - (x, y)).T).max())
        for angle_deg, (k1, k2) in itertools.product(_RIM_ANGLES_DEG, _PROFILES):
            square = np.deg2rad(angle_deg) ** 2
            focal = rim_px / float(np.sqrt(square) * (1.0 + square * (k1 + square * k2)))
            model = KannalaBrandt((float(x), float(y)), (focal, focal), k1, k2)
            directions, valid = model.unproject(corners.pixels)
            _, miss = poses_from_directions(corners, directions, valid)
            yield float(np.median(miss)) * focal, model


def _adjusted(corners: Corners, model: KannalaBrandt) -> Adjusted:
    directions, valid = model.unproject(corners.pixels)
    poses, _ = poses_from_directions(corners, directions, valid)
    solution = Solution(model, poses)
    for free, soft_px in zip((_FREE_FIRST, FREE), _SOFT_PX, strict=True):
        adjusted = adjust(corners, solution, free, soft_px=soft_px)
        solution = adjusted.solution
    return adjusted
