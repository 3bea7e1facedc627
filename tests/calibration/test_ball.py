"""Mirror balls found in ray-traced pictures: every pixel's direction against the traced one."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calibration.ball import BallFit, fit_ball, pose
from calibration.ball_cli import calibrate_ball
from calibration.ball_cone import Pinhole, cone_distance_px, distant_pinhole
from calibration.ball_outline import Outline, find_outline, marked_outline
from calibration.camera import LEVEL
from calibration.files import read_calibration, read_records
from calibration.report_cli import report
from calibration.sharpness import pixels_per_rad
from calibration.up_cli import calibrate_up
from capture.errors import InputError
from capture.radiance import RadianceImage
from capture.radiance_files import write_radiance
from tests.calibration.ball_pictures import BallScene, photograph, scene_of, trace

SIZE = (480, 460)
HALFWAY = np.radians(90.0)


@cache
def shot(distance_ratio: float, off_axis_rad: float = 0.0) -> tuple[BallScene, np.ndarray]:
    scene = scene_of(distance_ratio, 210.0, SIZE, off_axis_rad)
    return scene, photograph(scene, supersampling=3)


@cache
def outline_of(distance_ratio: float, off_axis_rad: float = 0.0) -> Outline:
    """The outline in a picture whose pinhole is known."""
    scene, picture = shot(distance_ratio, off_axis_rad)
    return find_outline(picture, Pinhole(scene.focal_px, scene.principal_px))


@cache
def distant_outline() -> Outline:
    """The outline in the nearest picture, if the ball is taken to be far away."""
    return find_outline(shot(5.0)[1], distant_pinhole(SIZE))


def errors(fit: BallFit, scene: BallScene) -> tuple[np.ndarray, np.ndarray]:
    """Angle from the axis of the calibrated pixels, and the error of their directions, in rad."""
    pixels = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), axis=-1)[::3, ::3]
    truth, _ = trace(scene, pixels)
    seen, valid = fit.calibration.unproject(pixels)
    angle = fit.calibration.axis_angle(seen)[valid]
    chord = np.linalg.norm(seen - truth @ LEVEL.T, axis=-1)[valid]
    return angle, 2 * np.arcsin(chord / 2)


@pytest.mark.parametrize(("ratio", "off_axis_rad"), [(5.0, 0.3), (10.0, 0.0), (20.0, 0.3)])
def test_directions_are_those_that_were_traced(ratio: float, off_axis_rad: float) -> None:
    scene, _ = shot(ratio, off_axis_rad)
    pinhole = Pinhole(scene.focal_px, scene.principal_px)
    fit = fit_ball(outline_of(ratio, off_axis_rad), SIZE, pinhole)
    angle, error = errors(fit, scene)
    assert fit.distance_ratio == pytest.approx(ratio, rel=2e-3)
    assert np.degrees(np.quantile(error[angle < HALFWAY], 0.95)) < 0.1
    # What is claimed covers what happened, out to the end of what is valid.
    claimed = np.interp(angle, fit.angles_rad, fit.deviation_rad)
    assert np.mean(error < 2 * claimed) > 0.95
    assert angle.max() > np.radians(150)
    assert claimed.max() < np.radians(1.5)


def test_a_distance_in_radii_stands_in_for_the_focal_length() -> None:
    scene, _ = shot(5.0)
    pinhole = distant_pinhole(SIZE)
    outline = distant_outline()
    _, exact = errors(fit_ball(outline, SIZE, pinhole, (5.0, 0.0)), scene)
    angle, assumed = errors(fit_ball(outline, SIZE, pinhole, (20.0, 10.0)), scene)
    assert np.degrees(np.median(exact)) < 0.1
    assert 3 < np.degrees(assumed[angle < HALFWAY].max()) < 8  # what not knowing it costs
    fit = fit_ball(outline, SIZE, pinhole, (7.5, 2.5))
    angle, error = errors(fit, scene)
    claimed = np.interp(angle, fit.angles_rad, fit.deviation_rad)
    np.testing.assert_allclose(np.median(error / claimed), 1.0, rtol=0.1)  # 5 is what it may be


def test_a_hint_is_as_good_as_a_search() -> None:
    scene, picture = shot(10.0)
    pinhole = Pinhole(scene.focal_px, scene.principal_px)
    found = outline_of(10.0)
    hinted = find_outline(picture, pinhole, np.array([250.0, 220.0, 200.0]))
    np.testing.assert_allclose(hinted.centre_px, found.centre_px, atol=0.02)
    assert hinted.half_angle_rad == pytest.approx(found.half_angle_rad, rel=1e-4)


def test_a_ball_marked_by_hand_is_as_good_as_the_mark() -> None:
    # Seen off the axis by ψ, the outline of a narrow cone δ is f δ / cos ψ by f δ / cos² ψ.
    pinhole = Pinhole(2000.0, (0.0, 0.0))
    outline = marked_outline(np.array([1000.0, 0.0, 100.0]), 2.0, pinhole)
    cosine = np.cos(np.arctan(0.5))
    long, wide = (100 / 2000 * cosine**power for power in (2, 1))
    assert long < outline.half_angle_rad < wide
    assert outline.support == 0.0
    scene, _ = shot(10.0)
    pinhole = Pinhole(scene.focal_px, scene.principal_px)
    true = outline_of(10.0)
    x, y = true.centre_px
    off = np.array([x + 2, y - 1, scene.focal_px * true.half_angle_rad])
    marked = fit_ball(marked_outline(off, 2.0, pinhole), SIZE, pinhole)
    angle, error = errors(marked, scene)
    claimed = np.interp(angle, marked.angles_rad, marked.deviation_rad)
    assert 0.2 < np.median(error / claimed) < 1.5
    assert claimed.max() <= np.radians(20)
    with pytest.raises(InputError, match="by hand"):
        marked_outline(off, 0.0, pinhole)
    with pytest.raises(InputError, match="radius is 3 px"):
        marked_outline(np.array([9.0, 9.0, 3.0]), 1.0, pinhole)


def test_what_is_no_outline_is_refused() -> None:
    noise = np.random.default_rng(1).uniform(0, 1, (200, 240, 3)).astype(np.float32)
    with pytest.raises(InputError, match=r"--ball|no sharp outline"):
        find_outline(noise, distant_pinhole((240, 200)))
    with pytest.raises(InputError, match="no sharp outline"):
        find_outline(noise, distant_pinhole((240, 200)), np.array([120.0, 100.0, 70.0]))
    with pytest.raises(InputError, match="radius is 10 px"):
        find_outline(noise, distant_pinhole((240, 200)), np.array([120.0, 100.0, 10.0]))
    with pytest.raises(InputError, match=r"no ball found|stands out"):
        find_outline(np.ones_like(noise), distant_pinhole((240, 200)))


def test_points_on_a_cone_are_at_no_distance_from_it() -> None:
    pinhole = Pinhole(300.0, (10.0, 20.0))
    axis = np.array([0.4, -0.3, 1.0]) / np.sqrt(1.25)
    beside = np.cross(axis, [0.0, 1.0, 0.0])
    beside /= np.linalg.norm(beside)
    turn = np.linspace(0, 6, 9)[:, None]
    around = np.cos(turn) * beside + np.sin(turn) * np.cross(axis, beside)
    for half_angle, distance in ((0.2, 0.0), (0.2 + 1e-5, 1.0)):
        rays = np.cos(half_angle) * axis + np.sin(half_angle) * around
        pixels = 300 * rays[:, :2] / rays[:, 2:] + pinhole.principal_px
        cone = np.array([300 * 0.4 + 10, -300 * 0.3 + 20, 0.2])
        measured = cone_distance_px(pinhole, cone, pixels)
        # A radian is 300 to 300 / cos² of the angle from the camera's axis in pixels.
        assert np.all(measured >= distance * 1e-5 * 300 - 1e-9)
        assert np.all(measured <= distance * 1e-5 * 300 / rays[:, 2] ** 2 + 1e-9)


def test_a_pose_turns_left_looks_up_and_tilts() -> None:
    np.testing.assert_allclose(pose(0, 0, 0), LEVEL)
    forward, right = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    np.testing.assert_allclose(pose(np.pi / 2, 0, 0) @ forward, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(pose(0, np.pi / 2, 0) @ forward, [0, 1, 0], atol=1e-12)
    # Tilted clockwise the right hand side of the camera points down; level it is at −X.
    np.testing.assert_allclose(pose(0, 0, np.pi / 2) @ right, [0, -1, 0], atol=1e-12)


def test_the_sharpness_of_a_distant_ball_is_that_of_its_closed_form() -> None:
    # From far off r = R sin(θ/2): along the radius R cos(θ/2)/2 px/rad, the lesser, as across it
    # R sin(θ/2)/sin θ = R/(2 cos(θ/2)).
    scene, _ = shot(5.0)
    fit = fit_ball(distant_outline(), SIZE, distant_pinhole(SIZE), (1e6, 0.0))
    theta = np.array([0.3, 1.5, 2.5])
    directions = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=-1)
    radius = fit.calibration.model.radius_px
    np.testing.assert_allclose(
        pixels_per_rad(fit.calibration.model, directions), radius * np.cos(theta / 2) / 2, rtol=1e-5
    )
    assert scene.distance_ratio == 5.0


def test_the_command_writes_a_calibration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, picture = shot(10.0)
    seen = np.ones(picture.shape[:2], bool)
    image = RadianceImage(picture, np.zeros_like(picture), seen, ~seen)
    write_radiance(tmp_path / "ball.exr", image)
    calibrate_ball(
        tmp_path / "ball.exr", output=tmp_path / "cal.json", focal_px=scene.focal_px, pitch_deg=90
    )
    told = capsys.readouterr().out
    assert "D/R 10.0" in told
    assert "assumed" not in told
    calibration = read_calibration(tmp_path / "cal.json")
    back, _ = calibration.unproject(np.array(calibration.model.centre_px))
    assert back @ [0, -1, 0] == pytest.approx(1.0, abs=1e-3)  # the camera looked up
    # The file keeps the outline, and another pose does not lose it.
    calibrate_up(tmp_path / "cal.json", looks="level", output=tmp_path / "up.json")
    kept = read_records(tmp_path / "up.json")["ball_fit"]
    assert kept["picture"] == "ball.exr"
    assert kept["half_angle_rad"] == pytest.approx(np.arcsin(1 / calibration.model.distance_ratio))
    assert np.all(np.diff(kept["sigma_rad"]) > 0)
    capsys.readouterr()
    report(tmp_path / "up.json")
    told = capsys.readouterr().out
    assert told.startswith("mirror ball in ball.exr at ")
    assert f"{np.degrees(kept['sigma_rad'][-1]):.2f}° at " in told
    with pytest.raises(InputError, match="keeps no views"):
        report(tmp_path / "up.json", output=tmp_path / "report.html")

    calibrate_ball(
        tmp_path / "ball.exr",
        output=tmp_path / "cal.json",
        ball="240,230,210",
        reflectance="0.6,0.6,0.5",
        force=True,
    )
    assert "D/R 20 ± 10 is assumed" in capsys.readouterr().out
    assert read_calibration(tmp_path / "cal.json").reflectance == (0.6, 0.6, 0.5)
    with pytest.raises(InputError, match="--marked-px goes with --ball"):
        calibrate_ball(tmp_path / "ball.exr", output=tmp_path / "b.json", marked_px=2.0)
    for wrong in ({"reflectance": "1,2"}, {"seen_twice": "1,2"}, {"seen_twice": "1,2 3,4,5"}):
        with pytest.raises(InputError, match=r"r,g,b|x,y"):
            calibrate_ball(tmp_path / "ball.exr", output=tmp_path / "b.json", **wrong)
    with pytest.raises(InputError, match="not both"):
        calibrate_ball(
            tmp_path / "ball.exr", output=tmp_path / "b.json", focal_px=1.0, distance_ratio=2.0
        )
    with pytest.raises(InputError, match="x,y,radius"):
        calibrate_ball(tmp_path / "ball.exr", output=tmp_path / "b.json", ball="1,2")
