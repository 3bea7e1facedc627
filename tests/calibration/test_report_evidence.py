"""What a report draws equals what the lens, the poses and the errors are known to be."""

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibration.lens.record import check_record
from calibration.report.coverage import Cell, advice, bare_cells
from calibration.report.evidence import evidence_of
from calibration.report.figures import exaggeration
from capture.errors import InputError
from tests.calibration.lens_records import ALL_AROUND, LENS, known_record


def test_residuals_are_the_corners_errors_turned_about() -> None:
    record, calibration, errors = known_record([(0, 0), (40, 200)])
    evidence = evidence_of(record, calibration)
    assert_allclose(evidence.residuals_px, -errors, atol=1e-9)
    assert evidence.kept.tolist() == [False] + [True] * 39


def test_a_views_rms_is_over_its_kept_corners() -> None:
    record, calibration, errors = known_record([(0, 0), (40, 200)])
    evidence = evidence_of(record, calibration)
    lengths = np.hypot(*errors.T)
    assert_allclose(evidence.rms_px(0), np.sqrt(np.mean(lengths[1:20] ** 2)))
    assert_allclose(evidence.rms_px(1), np.sqrt(np.mean(lengths[20:] ** 2)))


def test_angles_and_tilt_are_those_the_board_was_put_at() -> None:
    record, calibration, _ = known_record([(40, 200)], noise_px=1e-9)
    evidence = evidence_of(record, calibration)
    # r = f θ: the lens is equidistant.
    offset = evidence.corners.pixels[1:] - LENS.centre_px
    assert_allclose(evidence.angle_rad[1:], np.hypot(*offset.T) / 80.0, atol=1e-9)
    turned = evidence.azimuth_rad[1:] - np.arctan2(offset[:, 1], offset[:, 0])
    assert_allclose(np.cos(turned), 1.0, atol=1e-9)
    # Facing the camera from 40° and tilted by 25° away: its normal has z = cos(40° + 25°).
    assert_allclose(np.rad2deg(evidence.tilt_rad(0)), 65.0)


def test_outward_is_away_from_the_axis() -> None:
    record, calibration, errors = known_record([(40, 0)])
    evidence = evidence_of(record, calibration)
    offset = evidence.corners.pixels - LENS.centre_px
    outward = np.sum(-errors * offset, axis=-1) / np.hypot(*offset.T)
    assert_allclose(evidence.outward_px, outward, atol=1e-9)


def test_the_whole_board_is_drawn_where_it_is_even_where_no_corner_was_found() -> None:
    record, calibration, errors = known_record([(0, 0), (30, 90)])
    second = record.views[1]
    some = msgspec.structs.replace(
        second,
        point_ids=second.point_ids[5:9],
        corners_px=second.corners_px[5:9],
        corner_sigma_px=second.corner_sigma_px[5:9],
        kept=second.kept[5:9],
    )
    fewer = msgspec.structs.replace(record, views=[record.views[0], some])
    evidence = evidence_of(fewer, calibration)
    assert_allclose(evidence.boards_px[1], np.array(second.corners_px) - errors[20:], atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"kept": [True]}, "do not match"),
        ({"point_ids": [0] * 20}, "do not match"),
        ({"point_ids": list(range(1, 21))}, "points 0 to 19"),
        ({"corner_sigma_px": [0.0] * 20}, "positive"),
    ],
)
def test_a_view_that_does_not_hold_together_is_refused(
    changes: dict[str, object], complaint: str
) -> None:
    record = known_record([(0, 0)])[0]
    broken = msgspec.structs.replace(record.views[0], **changes)
    with pytest.raises(InputError, match=rf"view 0\.png: .*{complaint}"):
        check_record(msgspec.structs.replace(record, views=[broken]))


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"views": []}, "no corner"),
        ({"sigma_rad": [0.1]}, "equally long"),
        ({"chosen": "ocam"}, "'ocam' is chosen"),
        ({"split_rad": [0.1]}, "equally long"),
        ({"warp_m": [0.0]}, "warp_m"),
    ],
)
def test_a_record_that_does_not_hold_together_is_refused(
    changes: dict[str, object], complaint: str
) -> None:
    record = known_record([(0, 0)])[0]
    with pytest.raises(InputError, match=complaint):
        check_record(msgspec.structs.replace(record, **changes))


def test_boards_all_around_leave_no_part_bare_and_nothing_to_advise() -> None:
    record, calibration, _ = known_record(ALL_AROUND, last_angle_rad=1.2)
    evidence = evidence_of(record, calibration)
    assert bare_cells(evidence) == []
    assert advice(evidence) == []


def test_the_side_without_boards_is_what_to_photograph() -> None:
    left_alone = [place for place in ALL_AROUND if place[1] not in (0, 30, 45, 315, 330)]
    record, calibration, _ = known_record(left_alone, last_angle_rad=1.2)
    evidence = evidence_of(record, calibration)
    bare = bare_cells(evidence)
    assert {cell.sector for cell in bare if cell.ring == 3} == {0}
    assert all(cell.sector in (0, 1, 7, None) for cell in bare)
    said = " ".join(advice(evidence))
    assert "right of the picture, 45° to 60° off the axis" in said
    assert "left" not in said


def test_a_ring_that_is_bare_is_named_as_one() -> None:
    far = [(50, azimuth) for azimuth in range(0, 360, 30)]
    record, calibration, _ = known_record(far, last_angle_rad=1.2)
    said = " ".join(advice(evidence_of(record, calibration)))
    assert "in the middle of the picture: no corner lies within 15°" in said
    assert "all around the middle of the picture, 15° to 30° off the axis" in said


def test_parts_outside_of_the_picture_are_not_asked_for() -> None:
    # The picture reaches 86° upwards and 114° sideways.
    sideways = [(angle, azimuth) for angle in (20, 45, 70, 95) for azimuth in (0, 180)]
    record, calibration, _ = known_record(sideways)
    outermost = {c.sector for c in bare_cells(evidence_of(record, calibration)) if c.ring == 6}
    assert outermost.isdisjoint({2, 6})


def test_few_flat_views_within_a_wide_picture_are_told() -> None:
    record, calibration, _ = known_record([(0, 0)])
    said = advice(evidence_of(record, calibration))
    assert "9 more pictures" in said[0]
    assert any("Tilt the board" in each for each in said)
    assert any("may reach 109°" in each for each in said)  # 1.9 rad


def test_a_cells_outline_runs_along_its_arcs() -> None:
    angles = np.rad2deg(np.arccos(Cell(2, 0).outline()[:, 2]))
    assert_allclose(np.sort(np.unique(angles.round(9))), [30.0, 45.0])
    azimuths = np.rad2deg(np.arctan2(Cell(2, 0).outline()[:, 1], Cell(2, 0).outline()[:, 0]))
    assert_allclose((azimuths.min(), azimuths.max()), (-22.5, 22.5))


@pytest.mark.parametrize("noise_px", [0.003, 0.1, 0.7, 30.0])
def test_residuals_are_exaggerated_by_a_round_number_to_a_length_that_can_be_seen(
    noise_px: float,
) -> None:
    record, calibration, errors = known_record([(0, 0), (40, 200)], noise_px=noise_px)
    scale = exaggeration(evidence_of(record, calibration))
    assert str(scale).rstrip("0") in ("1", "2", "5")
    drawn_px = scale * np.percentile(np.hypot(*errors[1:].T), 95)
    assert scale == 1 or 0.4 * 0.04 * 320 < drawn_px <= 0.04 * 320
