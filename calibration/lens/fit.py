"""A lens from views of a board: which views fit, which model they ask for, and how sure it is.

Input  : views of one camera at one setting and picture size, three or more; ten or more, tilted and
out to the rim, for a calibration that is worth having.
Output : LensFit; its calibration refuses rays where nothing was seen or the uncertainty is large.
Cost   : some seconds for 20 views of 50 corners.
Accuracy : what the corners leave possible, on simulated lenses of 194°. With 0.1 px of noise and
boards to 80° off the axis, 24 views of a 9×6 board of 30 mm squares leave 0.8 mrad at 80°, 48 views
0.5, and 48 views of a 14×9 board of 35 mm squares 0.24 (tests/benchmarks/lens.py).
Fails  : for optics without an axis of symmetry; a mirror optic is calibrated as the lens that would
take the mirrored picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.camera import Calibration
from calibration.lens.adjust import Solution, in_camera_m, typical_px
from calibration.lens.choice import Trial, chosen, try_lenses
from calibration.lens.corners import Corners, gather
from calibration.lens.quality import (
    UNCERTAINTY_LIMIT_RAD,
    Quality,
    assessed,
    inner_angle,
    valid_angle,
)
from calibration.lens.robust import Fit
from calibration.lens.screening import LEAST_VIEWS, screen
from calibration.lens.start import FREE, first_solution
from calibration.observations import Rejected, View
from capture.errors import InputError

Array = NDArray[np.float64]

_LEAST_CORNERS = 8

_LEAST_TILT_RAD = np.deg2rad(10.0)

_UNEXPLAINED = 0.15
"""Typical residual over the corners' spacing beyond which no lens explains them."""

_OUTERMOST = 5
"""How many corners must be as far out, or in, for an angle to count as seen."""


@dataclass(frozen=True, eq=False)
class LensFit:
    """A calibrated lens and all that it was made from.

    Attributes
    ----------
    calibration : Calibration
        Its valid angle is where `quality` ends being good enough, its inner angle where it begins.
    board : Board
    views : tuple of View
        Those used, V of them.
    rejected : tuple of Rejected
        Those not, with the reason.
    solution : Solution
        The lens with the boards' poses, the board's warp and the movement of the entrance pupil.
    residuals_px : (N, 2) float64
        Projected less found, of all corners of the used views, one view after the other.
    kept : (N,) bool
        False for the corners that were found wrong and left out.
    sigma_px : float
        Standard deviation of a coordinate of the kept corners.
    trials : tuple of Trial
        The lenses tried, fewest parameters first.
    chosen : Trial
        The one taken.
    quality : Quality
    """

    calibration: Calibration
    board: Board
    views: tuple[View, ...]
    rejected: tuple[Rejected, ...]
    solution: Solution
    residuals_px: Array
    kept: NDArray[np.bool_]
    sigma_px: float
    trials: tuple[Trial, ...]
    chosen: Trial
    quality: Quality


def fit_lens(board: Board, views: Sequence[View], rejected: Sequence[Rejected] = ()) -> LensFit:
    """Return the lens that the views tell of; `rejected` are pictures that gave none.

    Raises
    ------
    InputError
        If the views differ in size, fewer than three are usable, no lens explains them, or they
        leave the focal length open. The message names what to photograph.
    """
    size_px = _common_size(views)
    enough = [view for view in views if len(view) >= _LEAST_CORNERS]
    refused = [
        *rejected,
        *(
            Rejected(view.name, f"{len(view)} corners; {_LEAST_CORNERS} are wanted")
            for view in views
            if len(view) < _LEAST_CORNERS
        ),
    ]
    _check_count(enough, refused)
    corners = gather(board, enough)
    start = first_solution(corners, size_px)
    if not typical_px(start.residuals_px) < _UNEXPLAINED * corners.spacing_px():
        raise InputError(
            f"no lens explains the corners of {len(enough)} views: check that --board counts the "
            "inner corners of the board that was photographed"
        )
    screened = screen(corners, start.solution, FREE, size_px)
    refused += [Rejected(enough[view].name, why) for view, why in screened.reasons.items()]
    used = [enough[view] for view in screened.views]
    _check_count(used, refused)
    _check_tilt(screened.fit)

    inside = corners.views(screened.views)
    seen_rad = _seen(inside, screened.fit)
    trials = try_lenses(inside, screened.fit, seen_rad[1])
    best = chosen(trials)
    fit = best.fit
    model = fit.solution.model
    quality = assessed(inside, trials, best, seen_rad, size_px)
    _check_quality(quality)
    return LensFit(
        Calibration(model, size_px, valid_angle(quality), inner_angle_rad=inner_angle(quality)),
        board,
        tuple(used),
        tuple(refused),
        fit.solution,
        fit.residuals_px,
        fit.kept,
        fit.sigma_px,
        trials,
        best,
        quality,
    )


def _common_size(views: Sequence[View]) -> tuple[int, int]:
    sizes = [view.size_px for view in views]
    if not sizes:
        raise InputError("no picture shows the board: check --board and the pictures")
    common = max(set(sizes), key=sizes.count)
    odd = [f"{v.name} ({v.size_px[0]}×{v.size_px[1]})" for v in views if v.size_px != common]
    if odd:
        raise InputError(
            f"pictures of one camera must have one size, most are {common[0]}×{common[1]}; "
            f"leave out or turn back {', '.join(odd)}"
        )
    return common


def _check_count(used: Sequence[View], refused: Sequence[Rejected]) -> None:
    if len(used) >= LEAST_VIEWS:
        return
    reasons = "".join(f"; {each.name}: {each.reason}" for each in refused[:4])
    raise InputError(
        f"{len(used)} of {len(used) + len(refused)} pictures are usable and {LEAST_VIEWS} are the "
        f"least: photograph the board ten times or more, tilted, out to the rim{reasons}"
    )


def _seen(corners: Corners, fit: Fit) -> tuple[float, float]:
    """Return the angles between which all but a few corners were seen."""
    x, y, z = in_camera_m(corners, fit.solution)[fit.kept].T
    angles = np.sort(np.arctan2(np.hypot(x, y), z))
    return float(angles[_OUTERMOST - 1]), float(angles[-_OUTERMOST])


def _check_tilt(fit: Fit) -> None:
    """Raise InputError where all boards stand as the sensor does.

    A plane parallel to the sensor looks the same through a longer lens from farther away.
    """
    tilt = np.arccos(np.clip(np.abs(fit.solution.poses.R_camera_board[:, 2, 2]), 0.0, 1.0))
    if tilt.max() < _LEAST_TILT_RAD:
        raise InputError(
            "focal length and distance cannot be told apart: every board is parallel to the "
            "sensor; tilt the board by 30° or more in some pictures"
        )


def _check_quality(quality: Quality) -> None:
    """Raise InputError where the lens is not known in the middle of what was seen."""
    middle = float(np.mean(quality.seen_rad))
    sigma = float(np.interp(middle, quality.angle_rad, quality.sigma_rad))
    if not sigma <= UNCERTAINTY_LIMIT_RAD:
        raise InputError(
            f"directions stay uncertain by {sigma * 1e3:.0f} mrad: photograph the board more "
            "often, tilted, nearer, and out to the rim"
        )
