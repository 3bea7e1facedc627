"""How well a lens predicts corners that it was not fitted to.

A view that was left out still has an unknown pose. It is found from every other corner of the
view, with the lens held, and judged at the corners between; then the other way round. So every
corner is predicted by a lens fitted without its view and by a pose fitted without it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.lens.adjust import Free, Solution, adjust, residuals_px, typical_px
from calibration.lens.corners import Corners
from calibration.lens.robust import Fit
from calibration.models.parameters import parameters

Array = NDArray[np.float64]

_SOFT_SIGMAS = 2.4


def predicted_residuals_px(corners: Corners, solution: Solution) -> Array:
    """Return the residuals (N, 2) of corners, each with a pose fitted to the others by halves.

    All but the poses is held; the poses are where the search begins.
    """
    held = Free(np.zeros(len(parameters(solution.model)), np.bool_))
    soft_px = _SOFT_SIGMAS * typical_px(residuals_px(corners, solution))
    residuals = np.full_like(corners.pixels, np.nan)
    first = np.arange(len(corners.ids)) % 2 == 0
    for half in (first, ~first):
        posed = adjust(corners.where(half), solution, held, soft_px=soft_px).solution
        residuals[~half] = residuals_px(corners, posed)[~half]
    return residuals


def cross_validated_px(corners: Corners, fit: Fit, free: Free, folds: int) -> Array:
    """Return the residuals (N, 2) of all corners under lenses fitted without their views.

    Views are dealt to the folds in turn. Each lens begins from the fit of all views, which keeps
    every fold in the same minimum, and is not fitted to the corners that this found wrong.
    """
    views = np.arange(corners.view_count)
    start = fit.solution
    residuals = np.full_like(corners.pixels, np.nan)
    for fold in range(folds):
        inside, outside = views[views % folds != fold], views[views % folds == fold]
        right = corners.where(fit.kept).views(inside)
        trained = adjust(right, replace(start, poses=start.poses.views(inside)), free).solution
        solution = replace(trained, poses=start.poses.views(outside))
        residuals[np.isin(corners.view_of, outside)] = predicted_residuals_px(
            corners.views(outside), solution
        )
    return residuals
