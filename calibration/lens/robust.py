"""A lens adjusted to corners some of which are wrong: they are found, left out, and told.

Domain : most corners of most views are right, and their errors normal.
Cost   : three adjustments.
Fails  : where wrong corners agree with each other, as those of a moved board: screening.py looks
at whole views.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.lens.adjust import Free, Solution, adjust, residuals_px, typical_px
from calibration.lens.corners import Corners
from calibration.lens.covariance import covariance_of

Array = NDArray[np.float64]

OUTLIER_SIGMAS = 6.0
"""Length of a residual, in standard deviations of a coordinate, beyond which a corner is wrong.

No right one is that far off, but some views are worse than others, and what a lens gets wrong at
the rim must not be taken for the corner's fault.
"""

_SOFT_SIGMAS = 2.4
"""Scale of Cauchy's loss: 95 % efficient on normal errors."""

_LEAST_SIGMA_PX = 1e-6
"""Below it, differences between corners are rounding."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A lens, its board poses, and what each corner says of them.

    Attributes
    ----------
    solution : Solution
    residuals_px : (N, 2) float64
        Of all corners, projected less found.
    kept : (N,) bool
        False for corners that were found wrong and left out.
    sigma_px : float
        Standard deviation of a coordinate of the kept corners, of median sigma if they differ, by
        the degrees of freedom.
    covariance : (G, G) float64
        Of the free lens parameters, then of the warp, then of the pupil; see covariance.py.
    """

    solution: Solution
    residuals_px: Array
    kept: NDArray[np.bool_]
    sigma_px: float
    covariance: Array

    @property
    def rms_px(self) -> float:
        """Rms length of the kept corners' residuals."""
        return float(np.sqrt(np.mean(np.sum(self.residuals_px[self.kept] ** 2, axis=-1))))


def fit_robustly(corners: Corners, start: Solution, free: Free) -> Fit:
    """Return the fit that is reached from a start within some pixels.

    Cauchy's loss finds the wrong corners, least squares of the others the rest, so that the
    covariance is that of normal errors.
    """
    solution = start
    for _ in range(2):  # the scale of the first is that of the start
        scale = max(typical_px(residuals_px(corners, solution)), _LEAST_SIGMA_PX)
        solution = adjust(corners, solution, free, soft_px=_SOFT_SIGMAS * scale).solution
    kept = _right(corners, residuals_px(corners, solution))
    adjusted = adjust(corners.where(kept), solution, free)
    residuals = residuals_px(corners, adjusted.solution)
    inverse = relative_inverse_sigma(corners)[kept]
    unknowns = free.count + 6 * len(np.unique(corners.view_of[kept]))
    spare = max(2 * int(kept.sum()) - unknowns, 1)
    variance = float(np.sum(np.sum(residuals[kept] ** 2, axis=-1) * inverse**2)) / spare
    return Fit(
        adjusted.solution,
        residuals,
        kept,
        float(np.sqrt(variance)),
        covariance_of(adjusted, variance, free.lens_count),
    )


def relative_inverse_sigma(corners: Corners) -> Array:
    """Return 1 / sigma (N,) of the corners, 1 for the median sigma."""
    return np.asarray(np.median(corners.sigma_px) / corners.sigma_px)


def _right(corners: Corners, residuals: Array) -> NDArray[np.bool_]:
    """Return which corners (N,) are within `OUTLIER_SIGMAS` of where they should be."""
    scaled = residuals * relative_inverse_sigma(corners)[:, None]
    limit = OUTLIER_SIGMAS * max(typical_px(scaled), _LEAST_SIGMA_PX)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.hypot(*scaled.T) <= limit)
