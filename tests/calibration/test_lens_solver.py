"""Poses on the sphere, and the adjustment, against truth."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.lens.adjust import Free, Solution, adjust
from calibration.lens.corners import WARP_DEGREES, Corners, gather
from calibration.lens.poses import poses_from_directions
from calibration.lens.robust import fit_robustly
from calibration.lens.start import first_solution, hypotheses
from calibration.lens.validation import predicted_residuals_px
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.parameters import parameters, with_parameters
from tests.calibration.simulated_views import BOARD, simulated_views

LENS = KannalaBrandt((601.3, 597.2), (330.0, 331.0), -0.02, 0.004, -0.001, 0.0002)
SIZE_PX = (1200, 1200)
WIDE = np.deg2rad(100.0)


def corners_of(count: int = 8, noise_px: float = 0.0, seed: int = 0, **more: float) -> Corners:
    random = np.random.default_rng(seed)
    views = simulated_views(LENS, SIZE_PX, count, random, noise_px=noise_px, **more)
    return gather(BOARD, views)


def true_solution(corners: Corners) -> Solution:
    poses, _ = poses_from_directions(corners, *LENS.unproject(corners.pixels))
    return Solution(LENS, poses)


def test_poses_past_90_degrees_put_every_corner_in_its_direction() -> None:
    corners = corners_of(30, most_angle_rad=WIDE)
    directions, seen = LENS.unproject(corners.pixels)
    assert np.any(directions[:, 2] < -0.1)
    poses, miss = poses_from_directions(corners, directions, seen)
    assert np.all(miss < 1e-6)
    rotations = poses.R_camera_board
    products = rotations @ rotations.transpose(0, 2, 1)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    assert np.all(np.sum(rotations[:, :, 2] * poses.t_camera_board_m, axis=1) > 0)


def test_a_view_with_three_directions_has_no_pose() -> None:
    corners = corners_of(1)
    directions, seen = LENS.unproject(corners.pixels)
    seen[3:] = False
    _, miss = poses_from_directions(corners, directions, seen)
    assert miss[0] == np.pi


def test_adjustment_finds_lens_warp_and_pupil_of_corners_without_noise() -> None:
    corners = corners_of(8)
    truth = replace(
        true_solution(corners),
        warp_m=np.where(WARP_DEGREES == 2, [1e-3, -4e-4, 7e-4] + [0.0] * 9, 0.0),
        pupil_m=1.5e-3,
    )
    free = Free(np.ones(8, np.bool_), warp_degree=2, pupil=True)
    none = Free(np.zeros(8, np.bool_))
    off = adjust(corners, truth, none, most_steps=0).residuals_px
    exact = corners.with_pixels(corners.pixels + off)
    start = Solution(with_parameters(LENS, parameters(LENS) * 1.003), truth.poses)
    found = adjust(exact, start, free, most_steps=200).solution
    assert found.pupil_m == pytest.approx(1.5e-3, rel=1e-2)
    np.testing.assert_allclose(found.warp_m, truth.warp_m, atol=2e-5)
    np.testing.assert_allclose(found.model.project(RAYS)[0], LENS.project(RAYS)[0], atol=5e-3)


RAYS = np.array([[0.1, 0.0, 1.0], [1.0, 0.5, 0.8], [-1.0, 0.9, 0.3]])


def test_what_is_held_does_not_move() -> None:
    corners = corners_of(4, noise_px=0.2)
    start = true_solution(corners)
    held = Free(np.array([True, True, False, False] + [False] * 4))
    found = adjust(corners, start, held).solution
    assert found.model.focal_px == LENS.focal_px
    assert found.model.centre_px != LENS.centre_px
    assert found.pupil_m == 0
    assert not found.warp_m.any()


def test_wrong_corners_are_found_and_change_nothing() -> None:
    clean = corners_of(8, noise_px=0.1, seed=3)
    bad = np.zeros(len(clean.ids), np.bool_)
    bad[::40] = True
    spoilt = clean.with_pixels(clean.pixels + 8.0 * bad[:, None])
    start = true_solution(clean)
    fit = fit_robustly(spoilt, start, Free(np.ones(8, np.bool_)))
    without = fit_robustly(clean.where(~bad), start, Free(np.ones(8, np.bool_)))
    np.testing.assert_array_equal(fit.kept, ~bad)
    assert fit.sigma_px == pytest.approx(0.1, rel=0.08)
    np.testing.assert_allclose(
        parameters(fit.solution.model), parameters(without.solution.model), atol=2e-3
    )


def test_variance_grows_where_whole_views_are_off_together() -> None:
    """Noise that all corners of a view share is the pose's; a stretch of a view is the lens's."""
    corners = corners_of(20, noise_px=0.05, seed=5)
    start, free = true_solution(corners), Free(np.ones(8, np.bool_))
    independent = fit_robustly(corners, start, free)
    random = np.random.default_rng(1)
    stretch = 1 + 2e-3 * random.normal(size=(20, 1))[corners.view_of] * [1, -1]
    middle = np.array([corners.pixels[corners.of_view(v)].mean(axis=0) for v in range(20)])
    at = middle[corners.view_of]
    shared = fit_robustly(corners.with_pixels(at + (corners.pixels - at) * stretch), start, free)
    per_corner = [np.trace(fit.covariance) / fit.sigma_px**2 for fit in (independent, shared)]
    assert per_corner[1] > 2.5 * per_corner[0]


@pytest.mark.parametrize("seed", range(3))
def test_any_ten_views_start_the_lens_from_nothing(seed: int) -> None:
    corners = corners_of(10, noise_px=0.1, seed=100 + seed, most_angle_rad=WIDE)
    start = first_solution(corners, SIZE_PX)
    residual = np.hypot(*start.residuals_px.T)
    assert np.median(residual) < 0.2
    seen = RAYS / np.linalg.norm(RAYS, axis=1, keepdims=True)
    np.testing.assert_allclose(start.solution.model.project(seen)[0], LENS.project(seen)[0], atol=6)


@pytest.mark.parametrize(
    ("rim_deg", "offset", "k1", "k2"),
    [
        (40, (0.0, 0.0), 0.0, 0.0),
        (80, (0.15, -0.15), -1 / 24, 1 / 1920),
        (110, (0.0, 0.15), 1 / 12, 1 / 120),
    ],
)
def test_the_search_starts_from_the_lens_that_is_most_alike(
    rim_deg: int, offset: tuple[float, float], k1: float, k2: float
) -> None:
    """The adjustment forgives a far start; this is what the many are for."""
    angle = np.deg2rad(rim_deg)
    focal = 500 / (angle * (1 + k1 * angle**2 + k2 * angle**4))
    centre = (1199 / 2 + offset[0] * 1200, 1199 / 2 + offset[1] * 1200)
    lens = KannalaBrandt(centre, focal, k1, k2)
    random = np.random.default_rng(rim_deg)
    board = replace(BOARD, square_m=0.01) if rim_deg < 45 else BOARD
    views = simulated_views(
        lens, SIZE_PX, 6, random, board=board, most_angle_rad=angle, most_tilt_rad=0.6
    )
    _, found = min(hypotheses(gather(board, views), SIZE_PX), key=lambda each: each[0])
    assert found.centre_px == pytest.approx(centre, abs=1)
    assert (found.k1, found.k2) == (k1, k2)
    assert np.mean(found.focal_px) == pytest.approx(focal, rel=0.12)


def test_a_corner_has_no_part_in_what_predicts_it() -> None:
    corners = corners_of(2, noise_px=0.1)
    truth = true_solution(corners)
    pixels = corners.pixels.copy()
    pixels[[4, 61]] += (0.2, 0.0)
    moved = predicted_residuals_px(corners.with_pixels(pixels), truth)
    change = (moved - predicted_residuals_px(corners, truth))[[4, 61]]
    # What it is held against stays: only the scale of the loss feels it.
    np.testing.assert_allclose(change, [[-0.2, 0.0]] * 2, atol=2e-3)
