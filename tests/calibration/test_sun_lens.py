"""A lens's focal length and centre from the sun, against simulated days whose lens is known."""

from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calibration.camera import UP
from calibration.models.equidistant import Equidistant
from calibration.models.equisolid import Equisolid
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from calibration.models.mirror_ball_off_axis import MirrorBallOffAxis
from calibration.pose.sun_lens import LensBySun, lens_by_sun
from calibration.pose.sun_position import sun_directions
from capture.errors import InputError

LENS = Equidistant((159.5, 151.5), 95.0)
SHEET = Equidistant((162.5, 149.5), 98.0)
"""What a data sheet says of it."""

POSE = Rotation.from_euler("yxz", [25.0, 4.0, -3.0], degrees=True).as_matrix() @ UP
NOON_S = datetime(2026, 6, 21, 11, 0, tzinfo=UTC).timestamp()


def suns(hours: float, count: int = 41) -> NDArray[np.float64]:
    moments = NOON_S + 3600 * np.linspace(-hours, hours, count)
    return sun_directions(moments, *np.radians([48.2, 16.4]))


DAY = suns(5)
PIXELS = LENS.project(DAY @ POSE)[0]


def errors(found: LensBySun) -> NDArray[np.float64]:
    """Return the errors (6,) in standard deviations."""
    assert isinstance(found.model, Equidistant)
    turn = Rotation.from_matrix(found.R_world_camera @ POSE.T).as_rotvec()
    shift = np.subtract(found.model.centre_px, LENS.centre_px)
    stretch = np.log(found.model.focal_px / LENS.focal_px)
    return np.array([*turn, *shift, stretch]) / np.sqrt(np.diag(found.covariance))


@pytest.mark.parametrize("persistence", [0.0, 0.5])
def test_errors_are_within_what_is_said(persistence: float) -> None:
    inside = []
    for seed in range(12):
        noise = 0.1 * np.random.default_rng(seed).normal(size=PIXELS.shape)
        for last, now in pairwise(noise):
            now[:] = persistence * last + np.sqrt(1 - persistence**2) * now
        inside.append(np.abs(errors(lens_by_sun(SHEET, PIXELS + noise, DAY, 0.05))) < 1.96)
    assert 0.92 < np.mean(inside) <= 0.999


def test_two_focal_lengths_keep_their_ratio_and_the_distortion_stays() -> None:
    lens = KannalaBrandt((300.0, 280.0), (200.0, 204.0), -0.02)
    pixels, _ = lens.project(DAY @ POSE)
    found = lens_by_sun(replace(lens, focal_px=(206.0, 210.12)), pixels, DAY, 0.01)
    assert isinstance(found.model, KannalaBrandt)
    assert found.model.centre_px == pytest.approx((300.0, 280.0), abs=1e-3)
    assert found.model.focal_px == pytest.approx((200.0, 204.0), abs=1e-4)
    assert found.model.k1 == -0.02
    seen = np.arccos((DAY @ POSE)[:, 2])
    assert found.seen_rad == pytest.approx((seen.min(), seen.max()), abs=1e-4)


def test_glares_that_are_not_the_sun_change_nothing() -> None:
    noise = 0.1 * np.random.default_rng(0).normal(size=PIXELS.shape)
    glare = noise + np.where(np.arange(41)[:, None] % 9 == 4, [30.0, -20.0], 0.0)
    found = lens_by_sun(SHEET, PIXELS + glare, DAY, 0.05)
    np.testing.assert_array_equal(found.kept, np.arange(41) % 9 != 4)
    assert np.all(np.abs(errors(found)) < 3)


def test_a_path_that_leaves_the_lens_open_is_refused() -> None:
    short = suns(1.0)
    pixels = LENS.project(short @ POSE)[0] + np.random.default_rng(0).normal(size=(41, 2)) / 10
    with pytest.raises(InputError, match=r"uncertain by .*from morning to afternoon"):
        lens_by_sun(SHEET, pixels, short, 0.05)
    with pytest.raises(InputError, match="only 9 of 9 sightings"):
        lens_by_sun(SHEET, PIXELS[::5], DAY[::5], 0.05)


def test_another_kind_of_lens_is_refused() -> None:
    pixels, _ = Equisolid(LENS.centre_px, 95.0).project(DAY @ POSE)
    with pytest.raises(InputError, match="kind of lens"):
        lens_by_sun(LENS, pixels, DAY, 0.05)


def test_what_a_ball_shows_is_judged_about_the_way_back_to_the_camera() -> None:
    # The sun passes up to 67° from there; opposite lies the cone that a ball does not show.
    ball = MirrorBallOffAxis((170.0, 140.0), (160.0, 150.0), 900.0, 10.0)
    back = POSE * (1.0, -1.0, -1.0)
    pixels, seen = ball.project(DAY @ back)
    assert seen.all()
    found = lens_by_sun(ball, pixels, DAY, 0.05)
    assert found.seen_rad[1] < np.radians(80)
    assert found.direction_sigma_rad < np.radians(0.5)  # at the cone it is 5°


def test_a_mirror_ball_has_no_focal_length() -> None:
    with pytest.raises(InputError, match="mirror_ball has none: leave it out"):
        lens_by_sun(MirrorBall((160.0, 150.0), 90.0, 10.0), PIXELS, DAY, 0.05)
