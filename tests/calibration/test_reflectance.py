"""What a metal reflects, against Fresnel's equations in real numbers, and how it is measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.ball import measure_reflectance
from calibration.camera import Calibration
from calibration.files import read_calibration, write_calibration
from calibration.models.equidistant import Equidistant
from calibration.models.mirror_ball import MirrorBall
from calibration.models.mirror_ball_off_axis import MirrorBallOffAxis
from calibration.reflectance import reflected_share, straight_reflectance
from capture.errors import InputError
from capture.radiance import RadianceImage

CHROME = (0.55, 0.56, 0.53)
BALL = Calibration(MirrorBall((50.0, 50.0), 40.0, 8.0), (101, 101), 2.7, reflectance=CHROME)


def of_metal(n: float, k: float, incidence_rad: float) -> float:
    """Fresnel's equations for a conductor, without complex numbers."""
    cosine, sine = np.cos(incidence_rad), np.sin(incidence_rad)
    real = n**2 - k**2 - sine**2
    whole = np.hypot(real, 2 * n * k)
    a, b_squared = np.sqrt((whole + real) / 2), (whole - real) / 2
    across = ((a - cosine) ** 2 + b_squared) / ((a + cosine) ** 2 + b_squared)
    ratio = sine * sine / cosine
    along = across * ((a - ratio) ** 2 + b_squared) / ((a + ratio) ** 2 + b_squared)
    return (across + along) / 2


def test_the_equations_are_fresnels() -> None:
    # n = 2 and k = 3 reflect (1 + 9) / (9 + 9) straight on.
    angles = np.radians([0, 20, 45, 70, 85])
    shares = reflected_share([10 / 18] * 3, angles)
    np.testing.assert_allclose(shares[:, 1], [of_metal(2, 3, i) for i in angles], rtol=1e-12)
    np.testing.assert_allclose(reflected_share(CHROME, 0.0), CHROME, rtol=1e-12)
    np.testing.assert_allclose(reflected_share(CHROME, np.pi / 2), 1.0)


@pytest.mark.parametrize(("n", "k"), [(0.06, 3.6), (0.96, 6.7), (1.9, 3.6), (2.9, 3.1), (3.1, 3.3)])
@pytest.mark.parametrize(("angle_deg", "error"), [(60, 0.02), (75, 0.083), (82, 0.127)])
def test_real_metals_err_by_what_is_stated(
    n: float, k: float, angle_deg: float, error: float
) -> None:
    straight = of_metal(n, k, 0.0)
    share = reflected_share([straight] * 3, np.radians(angle_deg))[0]
    assert abs(share / of_metal(n, k, np.radians(angle_deg)) - 1) < error


@pytest.mark.parametrize("incidence_rad", [0.0, 0.7, 1.4])
def test_a_measured_share_gives_the_reflectance_back(incidence_rad: float) -> None:
    share = reflected_share(CHROME, incidence_rad)
    np.testing.assert_allclose(straight_reflectance(share, incidence_rad), CHROME, rtol=1e-9)


def test_what_no_metal_reflects_is_refused() -> None:
    for share in ((0.1, 0.5, 0.5), (0.5, 0.5, 1.1)):
        with pytest.raises(InputError, match="a metal reflects"):
            straight_reflectance(share, 0.2)
    for wrong in ((0.5, 0.5), (0.5, 0.5, 1.0), (0.5, 0.5, float("nan"))):
        with pytest.raises(InputError, match="reflectance is three numbers"):
            replace(BALL, reflectance=wrong)
    lens = Equidistant((50.0, 50.0), 30.0)
    with pytest.raises(InputError, match="a mirror ball's; the model is equidistant"):
        Calibration(lens, (101, 101), 1.0, reflectance=CHROME)


def test_light_falls_on_the_ball_halfway_between_camera_and_source() -> None:
    # From a ray to the ball at α from its axis: i is what lies between −ray and where it goes, over
    # two, however far the ball.
    pixels = np.array([[50.0, 50.0], [70.0, 50.0], [50.0, 86.0]])
    offset = np.hypot(*(pixels - 50.0).T) / 40.0
    off_axis = MirrorBallOffAxis((50.0, 50.0), (50.0, 50.0), 40 * np.sqrt(63), 8.0)
    for camera in (BALL, replace(BALL, model=off_axis)):
        directions, _ = camera.unproject(pixels)
        view_rad = np.arctan(offset / np.sqrt(63))
        twice = camera.axis_angle(directions) + view_rad
        np.testing.assert_allclose(camera.incidence_rad(directions), twice / 2, rtol=1e-9)


def test_a_thing_seen_twice_tells_the_reflectance() -> None:
    direction, _ = BALL.unproject(np.array([75.0, 40.0]))
    radiance = np.full((101, 101, 3), 1.0)
    radiance[:, :90] *= BALL.reflected_share(direction)
    plane = np.ones((101, 101), bool)
    image = RadianceImage(radiance, np.zeros_like(radiance), plane, ~plane)
    direct, mirrored = np.array([95.0, 40.0]), np.array([75.0, 40.0])
    assert measure_reflectance(image, BALL, direct, mirrored) == pytest.approx(CHROME, rel=1e-6)
    for there in ([99.0, 40.0], [1.0, 40.0], [50.0, 120.0]):
        with pytest.raises(InputError, match=r"the thing itself at .* picture's edge"):
            measure_reflectance(image, BALL, np.array(there), mirrored)
    with pytest.raises(InputError, match="not in the ball"):
        measure_reflectance(image, BALL, direct, np.array([95.0, 50.0]))
    in_ball = replace(image, clipped=radiance[..., 0] < 1)
    with pytest.raises(InputError, match="its reflection at 75,40 is clipped"):
        measure_reflectance(in_ball, BALL, direct, mirrored)


def test_a_file_keeps_the_reflectance(tmp_path: Path) -> None:
    write_calibration(tmp_path / "ball.json", BALL)
    assert read_calibration(tmp_path / "ball.json").reflectance == CHROME
