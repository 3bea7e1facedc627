"""Views that do not fit together with the others, found and told why.

Domain : most views are right. A view is judged by how its own corners fit, by the median, and by
how many of them are wrong, with one lens for all.
Fails  : for a mirrored picture of a lens whose axis is at the picture's centre: nothing differs.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.lens.adjust import Free, Solution, adjust, residuals_px, typical_px
from calibration.lens.corners import Corners
from calibration.lens.poses import poses_from_directions
from calibration.lens.robust import OUTLIER_SIGMAS, Fit, fit_robustly, relative_inverse_sigma
from calibration.models.parameters import parameters

Array = NDArray[np.float64]

LEAST_VIEWS = 3

_NOISY = 4.0
"""A view's typical residual over that of the middle view, beyond which it is left out."""

_SUSPECT = 1.5
"""A typical residual over the middle view's, beyond which a view is tried mirrored."""

_WRONG_SHARE = 0.35
"""Share of wrong corners beyond which a view is left out."""

_LEAST_PX = 0.1
"""A typical residual below this is never held against a view."""

_SCRAMBLED = 0.15
"""Typical residual over the corners' spacing beyond which it is not noise but another order."""

_SMOOTH = 0.5
"""Correlation of neighbours' residuals above which they are the view's, not the corners'."""


@dataclass(frozen=True, eq=False)
class Screened:
    """The fit of the views that are right.

    Attributes
    ----------
    fit : Fit
        Of the corners of `views` alone.
    views : (W,) int64
        Which of all views are right.
    reasons : dict of int to str
        Why each other view is not, as a sentence's end.
    """

    fit: Fit
    views: NDArray[np.int64]
    reasons: dict[int, str]


def screen(corners: Corners, start: Solution, free: Free, size_px: tuple[int, int]) -> Screened:
    """Return the fit of all views that agree on one lens, the worst left out one by one."""
    views = np.arange(corners.view_count)
    solution = start
    while True:
        inside = corners.views(views)
        poses = start.poses.views(views)
        fit = fit_robustly(inside, replace(solution, poses=poses), free)
        solution = fit.solution
        typical, wrong = _judged(inside, fit)
        limit = max(_NOISY * float(np.median(typical)), _LEAST_PX)
        badness = np.maximum(typical / limit, wrong / _WRONG_SHARE)
        behind = _from_behind(solution)
        if behind.sum() <= len(views) / 2:  # or the numbers of all are mirrored, which is no fault
            badness[behind] = np.inf
        for view in np.flatnonzero(typical > _SUSPECT * np.median(typical)):
            if _mirrored(inside.views(np.array([view])), fit, size_px):
                badness[view] = np.inf
        if badness.max() <= 1 or len(views) <= LEAST_VIEWS:
            break
        views = np.delete(views, int(np.argmax(badness)))
    out = np.setdiff1d(np.arange(corners.view_count), views)
    reasons = {int(view): _reason(corners.views(np.array([view])), fit, size_px) for view in out}
    return Screened(fit, views, reasons)


def _from_behind(solution: Solution) -> NDArray[np.bool_]:
    """Return which boards (V,) show the camera their back."""
    into = solution.poses.R_camera_board[:, :, 2]
    return np.asarray(np.sum(into * solution.poses.t_camera_board_m, axis=-1) < 0)


def _judged(corners: Corners, fit: Fit) -> tuple[Array, Array]:
    """Return the typical residual (V,) of each view in px, and its share (V,) of wrong corners."""
    scaled = fit.residuals_px * relative_inverse_sigma(corners)[:, None]
    parts = [corners.of_view(view) for view in range(corners.view_count)]
    typical = np.array([typical_px(scaled[part]) for part in parts])
    wrong = np.array([float(np.mean(~fit.kept[part])) for part in parts])
    return typical, wrong


def _reason(view: Corners, fit: Fit, size_px: tuple[int, int]) -> str:
    """Return why a view that was left out does not fit the lens of the others."""
    alone, residuals, behind = _posed(view, fit)
    limit_px = OUTLIER_SIGMAS * max(fit.sigma_px, _LEAST_PX)
    if _mirrored(view, fit, size_px):
        return "its picture is mirrored: flip it back"
    if not alone < _SCRAMBLED * view.spacing_px():
        return "its corners fit no pose of the board: another board, or they are in a wrong order"
    if behind:
        return "its corners are numbered as in a mirror: the board is seen from behind"
    if _neighbour_correlation(view, residuals) > _SMOOTH:
        return (
            f"its corners are off by {alone:.2f} px together: the camera or the board moved, the "
            "board was bent, or the lens was set differently"
        )
    wrong = int(np.sum(~(np.hypot(*residuals.T) <= limit_px)))
    if 0 < wrong < len(residuals) / 2:
        return f"{wrong} of its {len(residuals)} corners are wrong: glare, or something before it"
    return (
        f"its corners are off by {alone:.2f} px each its own way: blurred or out of focus; "
        "use more light or a shorter exposure"
    )


def _mirrored(view: Corners, fit: Fit, size_px: tuple[int, int]) -> bool:
    """Whether a view fits the lens much better after it is mirrored."""
    flipped = view.with_pixels((size_px[0] - 1, 0) + view.pixels * (-1, 1))
    return _posed(flipped, fit)[0] < _posed(view, fit)[0] / 2


def _posed(view: Corners, fit: Fit) -> tuple[float, Array, bool]:
    """Fit one view's pose with the lens held.

    Return the typical residual in px, the residuals (n, 2), and whether the board shows its back.
    """
    model = fit.solution.model
    directions, valid = model.unproject(view.pixels)
    poses, _ = poses_from_directions(view, directions, valid)
    if not np.all(np.isfinite(poses.t_camera_board_m)):
        return np.inf, np.full_like(view.pixels, np.nan), False
    held = Free(np.zeros(len(parameters(model)), np.bool_))
    start = replace(fit.solution, poses=poses)
    for soft_px in (10.0, 1.0):
        start = adjust(view, start, held, soft_px=soft_px).solution
    residuals = residuals_px(view, start)
    return typical_px(residuals), residuals, bool(_from_behind(start)[0])


def _neighbour_correlation(view: Corners, residuals: Array) -> float:
    """Return the correlation of residuals at points one apart in their numbers and on the board."""
    finite = np.asarray(np.isfinite(residuals).all(axis=-1))
    beside = np.hypot(*np.diff(view.points_m, axis=0)[:, :2].T)
    pair = (np.diff(view.ids) == 1) & (beside < 1.5 * np.median(beside)) & finite[1:] & finite[:-1]
    first, second = residuals[:-1][pair].ravel(), residuals[1:][pair].ravel()
    size = float(np.sqrt(np.sum(first**2) * np.sum(second**2)))
    return float(np.sum(first * second)) / size if size > 0 else 0.0
