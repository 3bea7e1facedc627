"""A whole calibration: what is chosen, said and kept, and what is refused (rows C1 to C7)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.board import Board
from calibration.camera import Calibration
from calibration.files import read_calibration, write_calibration
from calibration.lens.adjust import residuals_px
from calibration.lens.choice import Trial, chosen
from calibration.lens.corners import gather
from calibration.lens.fit import LensFit, fit_lens
from calibration.lens.quality import UNCERTAINTY_LIMIT_RAD, Quality, inner_angle
from calibration.lens.record import read_lens_record, record_of, restored, summary
from calibration.lens.screening import screen
from calibration.lens.start import FREE, first_solution
from calibration.lens.uncertainty import direction_difference, fan
from calibration.models.double_sphere import DoubleSphere
from calibration.observations import Rejected, View
from capture.errors import InputError
from tests.calibration.simulated_views import BOARD, simulated_views, view_of

LENS = DoubleSphere((421.3, 396.2), 190.0, -0.15, 0.6)
SIZE_PX = (800, 800)


def views_of(count: int, seed: int = 0, **more: float) -> list[View]:
    random = np.random.default_rng(seed)
    return simulated_views(LENS, SIZE_PX, count, random, **more)


def changed(view: View, corners_px: np.ndarray, name: str) -> View:
    return replace(view, corners_px=corners_px, name=name)


@pytest.fixture(scope="module")
def fit() -> LensFit:
    return fit_lens(BOARD, views_of(10, seed=1), [Rejected("dark.png", "no board was found")])


def test_the_lens_is_found_within_what_is_said(fit: LensFit) -> None:
    quality = fit.quality
    at = fan(quality.seen_rad, quality.seen_rad[1])
    error = np.linalg.norm(direction_difference(fit.calibration.model, LENS, at), axis=-1)
    sigma = np.interp(at.angle_rad, quality.angle_rad, quality.sigma_rad)
    assert np.mean(error < 2.5 * sigma[:, None]) > 0.95
    assert sigma.max() < 2e-3
    assert fit.sigma_px == pytest.approx(0.1, rel=0.1)


def test_no_more_lens_than_the_views_need_is_chosen(fit: LensFit) -> None:
    worse = {trial.candidate.label for trial in fit.trials if not trial.plausible}
    assert {"equisolid", "stereographic"} <= worse
    assert fit.chosen.plausible
    assert fit.chosen.parameter_count <= 6
    assert not fit.solution.warp_m.any()
    assert fit.solution.pupil_m == 0


def test_rays_are_taken_as_far_as_corners_were_seen(fit: LensFit) -> None:
    seen, _ = LENS.unproject(np.concatenate([view.corners_px for view in fit.views]))
    angles = np.sort(np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), seen[:, 2]))
    assert fit.calibration.valid_angle_rad == pytest.approx(angles[-5], abs=3e-3)
    beyond = fit.quality.angle_rad - fit.calibration.valid_angle_rad
    sigma = fit.quality.sigma_rad
    assert np.all(sigma[beyond > 0.05] > sigma[beyond <= 0].max())


def test_the_middle_is_refused_only_where_no_corner_tells_of_it() -> None:
    angle_rad = np.array([0.1, 0.5, 1.0, 1.5])
    lens = Quality(angle_rad, np.array([1e-3, 1e-3, 1e-3, 9e-3]), np.zeros(4), (0.3, 1.2))
    ring = replace(lens, sigma_rad=np.array([9e-3, 1e-3, 1e-3, 9e-3]))
    assert inner_angle(lens) == 0
    assert inner_angle(ring) == 0.3


def test_a_calibration_file_keeps_what_it_was_made_from(fit: LensFit, tmp_path: Path) -> None:
    path = tmp_path / "cal.json"
    write_calibration(path, fit.calibration, lens_fit=record_of(fit))
    calibration, record = read_calibration(path), read_lens_record(path)
    assert calibration.model == fit.calibration.model
    corners, solution = restored(record, calibration)
    np.testing.assert_allclose(residuals_px(corners, solution), fit.residuals_px, atol=2e-4)
    assert [view.kept for view in record.views] == [
        fit.kept[corners.of_view(view)].tolist() for view in range(corners.view_count)
    ]
    assert record.rejected == [Rejected("dark.png", "no board was found")]
    assert record.chosen in {trial.model for trial in record.trials}
    np.testing.assert_allclose(record.angle_rad, fit.quality.angle_rad)
    text = "\n".join(summary(record, calibration))
    assert "10 of 11 pictures used" in text
    assert "dark.png: no board was found" in text
    assert f"{fit.chosen.held_out_px:.3f} px" in text


def test_a_file_written_by_hand_keeps_no_views(tmp_path: Path) -> None:
    write_calibration(tmp_path / "cal.json", Calibration(LENS, SIZE_PX, 1.2))
    with pytest.raises(InputError, match="not made by fishlight calibrate lens"):
        read_lens_record(tmp_path / "cal.json")


def test_views_that_do_not_fit_are_left_out_with_the_reason() -> None:
    """Row C6, and the other ways in which one view can be wrong."""
    random = np.random.default_rng(7)
    views = views_of(12, seed=4)
    mirror = np.array([SIZE_PX[0] - 1.0, 0.0])
    grid = (mirror + views[1].corners_px * [-1, 1]).reshape(6, 9, 2)
    views[1] = changed(views[1], grid[:, ::-1].reshape(-1, 2), "mirrored")
    grid = views[3].corners_px.reshape(6, 9, 2)
    views[3] = changed(views[3], grid[:, ::-1].reshape(-1, 2), "from behind")
    blur = random.normal(size=(54, 2))
    views[5] = changed(views[5], views[5].corners_px + blur, "blurred")
    bulge = 3.0 * BOARD_SHAPE[:, None] * [1.0, 0.5]
    views[7] = changed(views[7], views[7].corners_px + bulge, "moved")
    views[9] = changed(views[9], random.permutation(views[9].corners_px), "scrambled")
    corners = gather(BOARD, views)
    found = screen(corners, first_solution(corners, SIZE_PX).solution, FREE, SIZE_PX)
    reasons = {views[view].name: reason for view, reason in found.reasons.items()}
    for name, word in {
        "mirrored": "mirrored",
        "from behind": "seen from behind",
        "blurred": "blurred",
        "moved": "moved",
        "scrambled": "wrong order",
    }.items():
        assert word in reasons.pop(name)
    assert not reasons
    assert found.fit.sigma_px == pytest.approx(0.1, rel=0.15)


BOARD_SHAPE = np.sin(np.linspace(0, np.pi, 9))[None].repeat(6, axis=0).ravel()


def test_two_views_are_refused_with_what_became_of_the_others() -> None:
    """Row C1."""
    with pytest.raises(InputError, match=r"2 of 3 pictures are usable and 3 are.*a: too dark"):
        fit_lens(BOARD, views_of(2), [Rejected("a", "too dark")])
    with pytest.raises(InputError, match="no picture shows the board"):
        fit_lens(BOARD, [])


@pytest.mark.slow
def test_boards_near_the_centre_limit_the_angle() -> None:
    """Row C2."""
    near = fit_lens(BOARD, views_of(6, most_angle_rad=np.deg2rad(45), most_tilt_rad=0.7))
    assert near.calibration.valid_angle_rad <= np.deg2rad(45)
    last = near.quality.sigma_rad[-1]
    assert last > UNCERTAINTY_LIMIT_RAD


def test_boards_parallel_to_the_sensor_are_refused() -> None:
    """Row C3."""
    random = np.random.default_rng(2)
    points = BOARD.points_m() - BOARD.points_m().mean(axis=0)
    offsets = random.uniform([-0.1, -0.1, 0.25], [0.1, 0.1, 0.5], (6, 3))
    flat = [
        view_of(f"{i}", SIZE_PX, LENS.project(points + offset)[0], random, 0.1)
        for i, offset in enumerate(offsets)
    ]
    with pytest.raises(InputError, match=r"cannot be told apart.*tilt the board"):
        fit_lens(BOARD, flat)


def test_another_board_than_was_photographed_is_refused() -> None:
    """Row C4: 9×6 corners read as 6×9."""
    turned = Board("checkerboard", 6, 9, BOARD.square_m)
    with pytest.raises(InputError, match=r"no lens explains.*--board"):
        fit_lens(turned, views_of(6))


def test_the_side_of_a_square_scales_the_poses_alone() -> None:
    """Row C5."""
    views = views_of(6)
    solutions = [
        first_solution(gather(board, views), SIZE_PX).solution
        for board in (BOARD, replace(BOARD, square_m=2 * BOARD.square_m))
    ]
    pixels = [each.model.project(np.array([0.8, 0.3, 0.5]))[0] for each in solutions]
    np.testing.assert_allclose(*pixels, atol=1e-2)
    distances = [np.linalg.norm(each.poses.t_camera_board_m, axis=1) for each in solutions]
    np.testing.assert_allclose(2 * distances[0], distances[1], rtol=1e-3)


def test_pictures_of_several_sizes_are_refused_by_name() -> None:
    """Row C7."""
    views = views_of(4)
    views[2] = replace(views[2], size_px=(600, 800), name="upright.jpg")
    with pytest.raises(InputError, match=r"most are 800×800.*upright\.jpg \(600×800\)"):
        fit_lens(BOARD, views)


def test_of_lenses_that_predict_alike_the_simplest_is_taken(fit: LensFit) -> None:
    few, many = fit.trials[0], fit.trials[-1]

    def trial(of: Trial, excess_px: float) -> Trial:
        return replace(of, excess_px=excess_px, excess_error_px=0.01, held_out_px=0.3 + excess_px)

    assert chosen((trial(few, 0.009), trial(many, 0.0))).candidate is few.candidate
    assert chosen((trial(few, 0.011), trial(many, 0.0))).candidate is many.candidate
