"""A camera's pose from the sun: its positions, its disc in pictures, and its path."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calibration.camera import UP
from calibration.models.equidistant import Equidistant
from calibration.pose.sun_disc import NoSun, SunDisc, find_sun
from calibration.pose.sun_position import celestial_pole, sun_directions
from calibration.pose.sun_track import clock_error, pose_by_sun
from capture.camera_files import read_camera_file
from capture.errors import InputError
from tests.calibration.sun_skies import FULL, LENS, add_cloud, camera, sky

LATITUDE_RAD, LONGITUDE_RAD = np.radians(48.2), np.radians(16.4)
NOON_S = datetime(2026, 6, 21, 11, 0, tzinfo=UTC).timestamp()
DAY_S = NOON_S + 3600 * np.linspace(-5, 5, 41)
SUN = sun_directions(DAY_S, LATITUDE_RAD, LONGITUDE_RAD)
POSE = Rotation.from_euler("yxz", [25.0, 4.0, -3.0], degrees=True).as_matrix() @ UP
SIGMA_RAD = np.deg2rad(0.05)


def turn_deg(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.degrees(Rotation.from_matrix(first @ second.T).magnitude()))


@pytest.mark.parametrize(
    ("utc", "latitude_deg", "longitude_deg", "altitude_deg", "azimuth_deg"),
    [
        # pvlib 0.16.1, spa_python (NREL's Solar Position Algorithm), 1010 hPa and 15 °C.
        ("2026-06-21T04:30:00+00:00", 48.2, 16.4, 13.1805, 69.3798),
        ("2026-12-21T11:00:00+00:00", 48.2, 16.4, 18.3899, 181.8258),
        ("2003-10-17T19:30:30+00:00", 39.742476, -105.1786, 39.8919, 194.3403),
        ("2026-03-20T14:45:00+00:00", 0.0, 0.0, 50.6128, 269.9999),
        ("2040-01-15T02:00:00+00:00", -33.87, 151.21, 77.3135, 4.5090),
        ("1985-08-01T16:00:00+00:00", 69.65, 18.96, 21.1850, 264.6042),
    ],
)
def test_the_sun_stands_where_another_algorithm_has_it(
    utc: str, latitude_deg: float, longitude_deg: float, altitude_deg: float, azimuth_deg: float
) -> None:
    moment = np.array([datetime.fromisoformat(utc).timestamp()])
    x, y, z = sun_directions(moment, np.radians(latitude_deg), np.radians(longitude_deg))[0]
    assert np.degrees(np.arcsin(y)) == pytest.approx(altitude_deg, abs=0.003)
    azimuth = np.degrees(np.arctan2(x, -z)) % 360  # from north by east
    level = np.cos(np.radians(altitude_deg))
    assert abs(azimuth - azimuth_deg) * level < 0.001


def test_the_sun_rises_in_the_east_and_goes_round_the_pole() -> None:
    assert SUN[0, 0] > 0.5  # +X is east
    assert SUN[20, 2] > 0.3  # +Z is south
    assert SUN[-1, 0] < -0.5
    away = np.degrees(np.arccos(SUN @ celestial_pole(LATITUDE_RAD)))
    np.testing.assert_allclose(away, 90 - 23.44, atol=0.05)  # refraction, and 23.44° is midsummer's


@given(st.floats(0.0, 1.3), st.floats(0.0, 6.28), st.floats(20.0, 200.0))
@settings(max_examples=15, deadline=None)
def test_a_clipped_sun_is_found_to_a_tenth_of_a_pixel(
    polar: float, azimuth: float, glare: float
) -> None:
    model = camera(UP)
    sun = np.array(
        [np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)]
    )
    found = found_in(sky(model, sun, glare=glare))
    assert isinstance(found, SunDisc)
    truth, _ = model.project(sun)
    assert np.hypot(*(found.centre_px - truth)) < 0.1
    assert found.radius_px < 20


def found_in(counts: NDArray[np.uint8]) -> SunDisc | NoSun:
    height, width = counts.shape[:2]
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    return find_sun(counts.min(axis=2).astype(np.float32), FULL, camera(UP).unproject(grid)[1])


HIGH = np.array([0.3, 0.9, 0.3]) / np.linalg.norm([0.3, 0.9, 0.3])
AT = tuple(camera(UP).project(HIGH)[0].tolist())
CLEAR = sky(camera(UP), HIGH)


@pytest.mark.parametrize(
    ("counts", "reason"),
    [
        (np.zeros((300, 320, 3), np.uint8), "black"),
        (sky(camera(UP), HIGH, glare=0.0), "too large"),
        (add_cloud(CLEAR, AT, (30.0, 6.0)), "not round"),
        (add_cloud(CLEAR, (220.0, 90.0), (6.0, 6.0)), "two bright patches"),
        (add_cloud(CLEAR, (AT[0] + 8, AT[1]), (6.0, 6.0), 215), "lopsided"),
        (add_cloud(CLEAR, AT, (60.0, 5.0), 215), "runs into"),
        (add_cloud(CLEAR, AT, (60.0, 50.0), 220), "stand out"),
        (sky(camera(UP), np.array([0.0, 0.01, 1.0])), "cut off by the rim"),
    ],
)
def test_pictures_without_a_clear_sun_say_why(counts: NDArray[np.uint8], reason: str) -> None:
    found = found_in(counts)
    assert isinstance(found, NoSun)
    assert reason in found.reason


def test_a_sun_beside_larger_clouds_is_found() -> None:
    cloudy = add_cloud(add_cloud(CLEAR, (220.0, 90.0), (30.0, 6.0)), (90.0, 100.0), (7.0, 25.0))
    found = found_in(cloudy)
    assert isinstance(found, SunDisc)
    assert np.hypot(*np.subtract(found.centre_px, AT)) < 0.1


def test_an_unclipped_sun_on_black_is_found() -> None:
    counts = np.zeros((300, 320, 3), np.float32)
    counts[100:102, 150:153] = 7.0
    found = found_in(counts)  # type: ignore[arg-type]
    assert isinstance(found, SunDisc)
    np.testing.assert_allclose(found.centre_px, (151.0, 100.5), atol=1e-6)


@given(st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_any_pose_is_found_among_clouds(seed: int) -> None:
    random = np.random.default_rng(seed)
    truth = Rotation.random(rng=random).as_matrix()
    sighted = noisy(SUN @ truth, random)
    wrong = random.choice(len(SUN), 15, replace=False)
    sighted[wrong] = Rotation.random(15, rng=random).apply(sighted[wrong])
    pose = pose_by_sun(sighted, SUN, SIGMA_RAD)
    assert turn_deg(pose.R_world_camera, truth) < 0.2
    assert np.linalg.det(pose.R_world_camera) == pytest.approx(1.0)
    assert pose.kept.sum() >= len(SUN) - 16


def noisy(directions: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    moved = directions + SIGMA_RAD * random.standard_normal(directions.shape)
    return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))


def test_the_stated_covariance_is_that_of_the_errors() -> None:
    random = np.random.default_rng(3)
    part = SUN[:14]
    poses = [pose_by_sun(noisy(part @ POSE, random), part, SIGMA_RAD / 10) for _ in range(150)]
    errors = Rotation.from_matrix([each.R_world_camera @ POSE.T for each in poses]).as_rotvec()
    stated = np.mean([each.covariance_rad2 for each in poses], axis=0)
    # Neighbours happen to err alike half of the time, so what is stated is somewhat more.
    ratio = np.linalg.eigvals(np.linalg.solve(stated, errors.T @ errors / len(errors))).real
    assert 0.5 < ratio.min() <= ratio.max() < 1.3
    assert poses[0].up_sigma_rad > 0
    assert poses[0].heading_sigma_rad > SIGMA_RAD / 4


def test_errors_that_persist_count_for_fewer() -> None:
    random = np.random.default_rng(5)
    drift = np.cumsum(SIGMA_RAD * random.standard_normal(SUN.shape), axis=0) / 3
    drifting = SUN @ POSE + drift
    drifting /= np.linalg.norm(drifting, axis=-1, keepdims=True)
    order = random.permutation(len(SUN))
    kept = pose_by_sun(drifting, SUN, SIGMA_RAD / 10)
    shuffled = pose_by_sun(drifting[order], SUN[order], SIGMA_RAD / 10)
    assert kept.heading_sigma_rad > 2 * shuffled.heading_sigma_rad


def test_a_clock_an_hour_off_leaves_no_residual_but_tilts_the_camera() -> None:
    sighted = SUN @ POSE
    late = sun_directions(DAY_S + 3600, LATITUDE_RAD, LONGITUDE_RAD)
    pose = pose_by_sun(sighted, late, SIGMA_RAD)
    assert np.degrees(pose.rms_rad) < 0.05
    assert turn_deg(pose.R_world_camera, POSE) == pytest.approx(15.0, abs=0.1)
    zenith = POSE.T @ [0.0, 1.0, 0.0]
    tilt_rad, fast_s, left_rad = clock_error(pose.R_world_camera, zenith, LATITUDE_RAD)
    # The zenith moves on a circle about the pole, whose radius is the sine of 90° − latitude.
    chord = 2 * np.arcsin(np.sin(np.radians(7.5)) * np.cos(LATITUDE_RAD))
    assert tilt_rad == pytest.approx(chord, abs=np.radians(0.1))
    assert fast_s == pytest.approx(3600, abs=40)
    assert np.degrees(left_rad) < 0.1


def test_a_tilt_that_no_clock_explains_is_left_over() -> None:
    # A zenith turned along the meridian keeps its hour and changes its distance from the pole.
    along = Rotation.from_rotvec([np.radians(6.0), 0.0, 0.0]).as_matrix()
    tilt_rad, fast_s, left_rad = clock_error(along, np.array([0.0, 1.0, 0.0]), LATITUDE_RAD)
    assert tilt_rad == pytest.approx(np.radians(6.0))
    assert left_rad == pytest.approx(np.radians(6.0))
    assert abs(fast_s) < 1e-6


@pytest.mark.parametrize(
    ("sighted", "sun", "match"),
    [
        (SUN[:2] @ POSE, SUN[:2], "found in 2 pictures"),
        (SUN[20:24:1] @ POSE, SUN[[20, 20, 20, 20]], "as far apart"),
        (sun_directions(NOON_S + 60.0 * np.arange(6), 0.8, 0.3) @ POSE,) * 2
        + ("two hours or more",),
        (SUN @ POSE * [-1.0, 1.0, 1.0], SUN, "mirrored|on one path"),
    ],
)
def test_tracks_that_do_not_tell_are_refused(
    sighted: NDArray[np.float64], sun: NDArray[np.float64], match: str
) -> None:
    with pytest.raises(InputError, match=match):
        pose_by_sun(sighted, sun, SIGMA_RAD)


def test_a_wrong_focal_length_is_seen_in_the_residuals() -> None:
    pixels, _ = LENS.project(SUN @ POSE)
    wrong: Any = type(LENS)(LENS.centre_px, 1.05 * 95.0)
    with pytest.raises(InputError, match=r"not this lens's|on one path"):
        pose_by_sun(wrong.unproject(pixels)[0], SUN, SIGMA_RAD)


DATA = Path(__file__).resolve().parents[2].parent / "shared/data/seq-vali-sky"


@pytest.mark.data
@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not here")
def test_a_real_camera_sees_the_sun_on_its_path() -> None:
    # Wherever the camera stands: a place is a rotation. Its pictures are mirrored (morning is on
    # the right, noon at the bottom) and its lens is about equidistant, 280 px a radian.
    grid = np.stack(np.meshgrid(np.arange(880), np.arange(880)), axis=-1)
    seen = np.hypot(*np.moveaxis(grid - 439.5, -1, 0)) < 430
    pixels, moments = [], []
    for path in sorted(DATA.rglob("ikarus_*.jpg")):
        found = find_sun(read_camera_file(path).counts.min(axis=2).astype(np.float32), 250.0, seen)
        if isinstance(found, SunDisc):
            pixels.append(found.centre_px)
            moment = datetime.strptime(path.name[7:26], "%Y-%m-%dT%H-%M-%S").replace(tzinfo=UTC)
            moments.append(moment.timestamp())
    assert len(pixels) == 7  # of eight; in one the sun shines through drops on the dome
    lens = Equidistant((439.5, 439.5), 280.0)
    sun = sun_directions(np.array(moments), LATITUDE_RAD, LONGITUDE_RAD)
    upright = np.array(pixels) * [-1, 1] + [879, 0]
    pose = pose_by_sun(lens.unproject(upright)[0], sun, SIGMA_RAD)
    assert pose.kept.all()
    assert np.degrees(pose.rms_rad) < 0.9
    with pytest.raises(InputError, match=r"mirrored|on one path"):
        pose_by_sun(lens.unproject(np.array(pixels))[0], sun, SIGMA_RAD)
