"""How surely the numbers of a lens are known, when the corners of a view may be wrong together.

Domain : views are independent of each other; within one, errors may go together, as those of a
board that is bent differently in every view, or of a picture with motion in it.
Output : the mean of two estimates. One is that of independent corners, raised by how much more the
views disagree: it has its shape from all corners, but no view may be worse than the others. The
other is the jackknife over views, which supposes nothing but takes its shape from few views.
Source : the jackknife as in J. MacKinnon and H. White, "Some heteroskedasticity-consistent
covariance matrix estimators with improved finite sample properties", Journal of Econometrics 29,
1985, with a view in an observation's place. The mean of both is our choice, by simulation: with
normal corners, bent boards, smooth errors of the picture and views of unequal noise, 10 or 24 of
them, 1.96 standard deviations held 93 to 96 % of the errors.
Fails  : for errors that all views share, as of another kind of lens: those are in no scatter.
"""

import numpy as np
from numpy.typing import NDArray

from calibration.lens.adjust import Adjusted

Array = NDArray[np.float64]

_DETERMINED = 1e-6
"""Share of the information that has to remain without a view, or its leaving out tells nothing."""


def covariance_of(adjusted: Adjusted, variance: float, lens_count: int) -> Array:
    """Return the covariance (G, G) of what was adjusted; `variance` is that of a coordinate.

    The first `lens_count` of the G numbers are the lens's.
    """
    whole = _inverse(adjusted.information.sum(axis=0))
    of_noise = max(_disagreement(adjusted, variance, lens_count), 1.0) * variance * whole
    return np.asarray((of_noise + _jackknife(adjusted, whole)) / 2.0)


def _jackknife(adjusted: Adjusted, whole: Array) -> Array:
    """Return the covariance that the changes tell which leaving out each view would make.

    Of the linearised equations; `whole` (G, G) is the inverse of all views' information.
    """
    views = len(adjusted.information)
    remaining = np.eye(len(whole)) - adjusted.information @ whole
    changes = (np.linalg.pinv(remaining, rcond=_DETERMINED) @ adjusted.pull[..., None])[..., 0]
    changes = changes @ whole
    return np.asarray((views - 1) / views * changes.T @ changes)


def _disagreement(adjusted: Adjusted, variance: float, lens_count: int) -> float:
    """Return the variance between views over what independent corners of that variance explain.

    The sum of squares of the views' pulls is compared with what is expected of it, which takes into
    account that every view has part in the lens that it is compared with.
    """
    if lens_count == 0:
        return 1.0
    rows = _inverse(adjusted.information.sum(axis=0))[:lens_count]
    metric = _inverse(rows[:, :lens_count])
    change = adjusted.pull @ rows.T
    own = rows @ adjusted.information @ rows.T
    expected = own - own @ metric @ own
    found = np.einsum("vi,ij,vj->", change, metric, change)
    return float(found / (variance * np.einsum("ij,vji->", metric, expected)))


def _inverse(symmetric: Array) -> Array:
    return np.asarray(np.linalg.pinv(symmetric, hermitian=True))
