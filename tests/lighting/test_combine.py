"""Two pictures of a mirror ball become one map without a camera and without a blind spot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.ball import ASSUMED_RATIO, fit_ball, pose
from calibration.ball_cone import distant_pinhole
from calibration.ball_outline import marked_outline
from calibration.camera import Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from calibration.models.mirror_ball import MirrorBall
from capture.errors import InputError
from capture.importing import read_photo_bracket
from capture.merge import merge_bracket
from capture.radiance import RadianceImage
from capture.radiance_files import write_radiance
from lighting.combine_cli import combine
from lighting.maps.combine import View, align_views, combine_views, trust
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.calibration.ball_pictures import room

BALL = MirrorBall((119.5, 119.5), 117.0, 8.0)
VALID = np.radians(165)
HEIGHT = 48
OPERATOR = np.radians(8)
FLIP = np.array([1.0, -1.0, 1.0])  # the room is drawn with +y down


def photographed(true_pose: np.ndarray, operator: float = OPERATOR) -> RadianceImage:
    """The room in the ball, and someone bright green who holds the camera."""
    camera = Calibration(BALL, (240, 240), VALID, true_pose)
    grid = np.stack(np.meshgrid(np.arange(240), np.arange(240)), axis=-1)
    radiance = np.zeros((240, 240, 3))
    for shift in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        seen, valid = camera.unproject(grid + np.array(shift))
        shown = room(np.where(valid[..., None], seen, 1.0) * FLIP)
        shown[camera.axis_angle(seen) < operator] = (0.0, 30.0, 0.0)
        radiance += np.where(valid[..., None], shown, 0.0) / 4
    plane = np.ones((240, 240), bool)
    return RadianceImage(radiance, np.zeros((240, 240, 3)), plane, ~plane)


def camera(R_world_camera: np.ndarray) -> Calibration:
    return Calibration(BALL, (240, 240), VALID, R_world_camera)


TRUE = [pose(0.3, -0.1, 0.02), pose(0.3 - np.pi / 2 + 0.05, -0.06, -0.03)]
PICTURES = [photographed(each) for each in TRUE]


def test_the_turn_is_found_without_knowing_the_yaw() -> None:
    views = [View(PICTURES[0], camera(TRUE[0])), View(PICTURES[1], camera(pose(2.0, 0.0, 0.0)))]
    aligned, turns = align_views(views, 1.3 * OPERATOR)
    np.testing.assert_array_equal(aligned[0].calibration.R_world_camera, TRUE[0])
    off = aligned[1].calibration.R_world_camera @ TRUE[1].T
    assert np.degrees(np.arccos(np.clip((np.trace(off) - 1) / 2, -1, 1))) < 0.3
    assert turns[0].correlation > 0.9


def test_neither_camera_nor_blind_spot_remains() -> None:
    views = [View(each, camera(stood)) for each, stood in zip(PICTURES, TRUE, strict=True)]
    both, confidence = combine_views(views, HEIGHT, 1.3 * OPERATOR)
    assert both.valid.all()
    truth = room(cell_directions(HEIGHT) * FLIP)
    assert np.median(np.abs(both.radiance / truth - 1)) < 0.03
    np.testing.assert_allclose(both.integral(), solid_angles(HEIGHT) @ truth.sum(axis=1), rtol=0.03)
    green = both.radiance[..., 1] > 3 * both.radiance[..., 0]
    assert not green.any()
    # One picture alone has both: the weakness is there.
    alone, confidence_alone = combine_views(views[:1], HEIGHT)
    assert not alone.valid.all()
    assert (alone.radiance[..., 1] > 3 * alone.radiance[..., 0]).any()
    hidden, _ = combine_views(views[:1], HEIGHT, 1.3 * OPERATOR)
    assert hidden.seen_share < alone.seen_share
    # The blind cone has no confidence, and the rim around it little; the other picture has both.
    behind = cell_directions(HEIGHT) @ TRUE[0][:, 2]
    assert confidence_alone[behind > np.cos(np.radians(10))].max() == 0
    rim = (behind > np.cos(np.radians(25))) & alone.valid
    assert 0 < confidence_alone[rim].min() < 0.5 < confidence_alone[rim].max() < 0.7
    assert confidence_alone[behind < 0].min() == 1
    assert confidence[behind > 0.9].min() > 0.8


def test_what_is_hidden_fades_in_over_half_its_angle() -> None:
    camera = Calibration(Equidistant((31.5, 31.5), 20.0), (64, 64), 1.5)
    seen = np.ones((HEIGHT, 2 * HEIGHT), bool)
    world = EnvironmentMap(np.ones((*seen.shape, 3), np.float32), seen, ~seen)
    whole, part = trust(camera, world, 0.0)[0], trust(camera, world, 0.4)[0]
    shown = np.clip((camera.axis_angle(cell_directions(HEIGHT)) - 0.4) / 0.2, 0, 1)
    np.testing.assert_allclose(part, shown * whole, atol=1e-12)


def test_equal_light_stays_equal_and_marks_travel() -> None:
    plane = np.ones((240, 240), bool)
    ones = np.full((240, 240, 3), 2.0)
    even = RadianceImage(ones, np.zeros_like(ones), plane, ~plane)
    full = RadianceImage(ones, np.zeros_like(ones), plane, plane)
    result, _ = combine_views([View(even, camera(TRUE[0])), View(full, camera(TRUE[1]))], HEIGHT)
    np.testing.assert_allclose(result.radiance, 2.0, rtol=1e-5)
    # Clipped is what the first did not see; elsewhere both agree.
    behind = cell_directions(HEIGHT) @ TRUE[0][:, 2]
    assert result.clipped[behind > np.cos(np.radians(10))].all()
    assert not result.clipped[behind < np.cos(np.radians(30))].any()


def test_where_one_exposure_clips_the_other_counts() -> None:
    plane = np.ones((240, 240), bool)
    radiance = np.full((240, 240, 3), 8.0)
    short = RadianceImage(radiance, np.zeros_like(radiance), plane, ~plane)
    bound = np.full_like(radiance, 3.0)
    long = RadianceImage(bound, np.zeros_like(bound), plane, plane)
    views = [View(long, camera(TRUE[0])), View(short, camera(TRUE[0]))]
    result, _ = combine_views(views, HEIGHT)
    np.testing.assert_allclose(result.radiance[result.valid], 8.0, rtol=1e-5)
    assert not result.clipped.any()
    # Unless it is below what is there at least: a picture that was altered after clipping.
    views[0] = View(
        replace(long, radiance=np.float32(2) * radiance.astype(np.float32)), camera(TRUE[0])
    )
    result, _ = combine_views(views, HEIGHT)
    np.testing.assert_allclose(result.radiance[result.valid], 16.0, rtol=1e-5)
    assert result.clipped[result.valid].all()


def test_a_coarse_lower_bound_does_not_smear_over_what_was_seen_well() -> None:
    plane = np.ones((240, 240), bool)
    lamp = np.full((240, 240, 3), 9.0)
    full = RadianceImage(lamp, np.zeros_like(lamp), plane, plane)
    dim = RadianceImage(lamp / 9, np.zeros_like(lamp), plane, ~plane)
    opposite = pose(0.3 + np.pi, -0.1, 0.02)
    result, _ = combine_views([View(dim, camera(TRUE[0])), View(full, camera(opposite))], HEIGHT)
    in_front = cell_directions(HEIGHT) @ TRUE[0][:, 2] < -0.5
    np.testing.assert_allclose(result.radiance[in_front], 1.0, rtol=1e-5)
    assert not result.clipped[in_front].any()


def test_pictures_of_two_places_are_refused() -> None:
    rng = np.random.default_rng(2)
    noise = np.exp(rng.standard_normal((240, 240, 3)))
    plane = np.ones((240, 240), bool)
    other = RadianceImage(noise, np.zeros_like(noise), plane, ~plane)
    with pytest.raises(InputError, match="does not fit"):
        align_views([View(PICTURES[0], camera(TRUE[0])), View(other, camera(TRUE[1]))])


def test_the_command_makes_a_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    radiance = [tmp_path / "a.exr", tmp_path / "b.exr"]
    calibrations = [tmp_path / "a.json", tmp_path / "b.json"]
    for index in range(2):
        write_radiance(radiance[index], PICTURES[index])
        write_calibration(calibrations[index], camera(TRUE[index]))
    output = tmp_path / "map.exr"
    shares = tmp_path / "confidence.exr"
    combine(
        radiance,
        calibration=calibrations,
        output=output,
        height=32,
        hide_deg=10.0,
        confidence=shares,
    )
    told = capsys.readouterr().out
    assert "turned by 0.0" in told  # their poses were right
    assert "100.0% of all directions" in told
    assert read_environment(output)[0].height == 32
    assert 0.5 < read_environment(shares)[0].radiance.min() <= 1
    with pytest.raises(InputError, match="2 pictures and 3 calibrations"):
        combine(radiance, calibration=[calibrations[0]] * 3, output=tmp_path / "c.exr")
    with pytest.raises(InputError, match="--hide-deg"):
        combine(radiance, calibration=calibrations, output=tmp_path / "c.exr", hide_deg=-1.0)


@pytest.mark.data
def test_two_crops_of_a_real_ball_become_one_map() -> None:
    folder = Path(__file__).resolve().parents[2].parent / "shared/data/brackets-mirrorball-uiuc"
    if not folder.exists():
        pytest.skip("brackets-mirrorball-uiuc is not there")
    views = []
    marks = {"10": (242, 233, 230), "160": (249, 233, 230)}
    for name, marked in marks.items():  # 1/10 and 1/160 s, as EXIF tells
        photograph, sensor, _ = read_photo_bracket([folder / f"Materials/{name}.JPG"])
        image = merge_bracket(photograph, sensor)
        pinhole = distant_pinhole(image.size_px)
        outline = marked_outline(np.array(marked, float), 3.0, pinhole)
        fit = fit_ball(outline, image.size_px, pinhole, ASSUMED_RATIO)
        views.append(View(image, fit.calibration))
    aligned, turns = align_views(views)
    assert all(turn.correlation > 0.9 for turn in turns)
    brightest = [combine_views(some, 64)[0].radiance.max() for some in (aligned[:1], aligned)]
    # Each is clipped at what it can show: the shortest at 16 times what the longest shows.
    assert brightest[1] > 10 * brightest[0]
