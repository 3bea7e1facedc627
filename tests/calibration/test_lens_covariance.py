"""What is said of a lens's uncertainty, against the errors of many lenses whose truth is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.lens.adjust import Free, Solution
from calibration.lens.corners import Corners, gather
from calibration.lens.poses import poses_from_directions
from calibration.lens.robust import fit_robustly
from calibration.lens.uncertainty import direction_covariance, direction_difference, fan
from calibration.models.kannala_brandt import KannalaBrandt
from tests.calibration.simulated_views import BOARD, simulated_views

LENS = KannalaBrandt((421.3, 396.2), 210.0, -0.02, 0.004)
FREE = Free(np.array([True] * 5 + [False] * 2))
AT = fan((0.0, np.deg2rad(75.0)), np.deg2rad(75.0), count=12)


def bent(corners: Corners, random: np.random.Generator, size_px: float) -> Corners:
    """Return corners moved smoothly, in each view another way."""
    shapes = corners.warp_shapes[:, :5]
    by_view = size_px * random.normal(size=(corners.view_count, 5, 2))
    return corners.with_pixels(
        corners.pixels + np.einsum("nk,nkc->nc", shapes, by_view[corners.view_of])
    )


def covered(bend_px: float, repeats: int) -> NDArray[np.float64]:
    """Return the share of errors (12,) by angle that are within 1.96 standard deviations."""
    inside = []
    for seed in range(repeats):
        random = np.random.default_rng(seed)
        corners = bent(
            gather(BOARD, simulated_views(LENS, (800, 800), 12, random)), random, bend_px
        )
        poses, _ = poses_from_directions(corners, *LENS.unproject(corners.pixels))
        fit = fit_robustly(corners, Solution(LENS, poses), FREE)
        model = fit.solution.model
        variance, worst = np.linalg.eigh(direction_covariance(model, FREE.lens, fit.covariance, AT))
        error = direction_difference(model, LENS, AT)
        along = np.einsum("ajk,ajk->aj", error, worst[..., -1])
        inside.append(np.abs(along) < 1.96 * np.sqrt(variance[..., -1]))
    return np.mean(inside, axis=(0, 2))


@pytest.mark.parametrize("bend_px", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
def test_errors_are_within_what_is_said_at_every_angle(bend_px: float) -> None:
    # Errors of one lens go together: 40 lenses leave ±0.04 of the share's own noise.
    share = covered(bend_px, 40)
    assert np.all(share > 0.87)
    assert 0.90 < share.mean() < 0.99
