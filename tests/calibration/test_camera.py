"""The camera as a whole: pose, limits, vignetting, and the size of its pictures."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.camera import LEVEL, UP, Calibration, ImageCircle
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from capture.errors import InputError

SIZE = (400, 300)
CENTRE = (199.5, 149.5)
FISHEYE = Calibration(Equidistant(CENTRE, 90.0), SIZE, np.radians(93.0))
AZIMUTHS = [(1, 0), (0, 1), (-1, 0), (0, -1), (0.5**0.5, 0.5**0.5)]
"""cos φ and sin φ of 0°, 90°, 180°, 270° and 45°."""


def test_a_level_camera_looks_along_z_with_the_sky_above() -> None:
    directions = np.array([[0.0, 0, 1], [0, 1, 0], [1, 0, 0]])
    pixels, valid = replace(FISHEYE, R_world_camera=LEVEL).project(directions)
    assert valid.all()
    # 90° is 90 · π/2 px away: up in the picture is +Y; +X is to the left of who looks along +Z.
    quarter = 45 * np.pi
    expected = np.array(CENTRE) + np.array([[0, 0], [0, -quarter], [-quarter, 0]])
    np.testing.assert_allclose(pixels, expected, atol=1e-9)


def test_a_camera_that_looks_up_has_minus_z_at_its_top_and_minus_x_at_its_right() -> None:
    directions = np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    pixels, valid = replace(FISHEYE, R_world_camera=UP).project(directions)
    assert valid.all()
    quarter = 45 * np.pi
    expected = np.array(CENTRE) + np.array([[0, 0], [0, -quarter], [quarter, 0]])
    np.testing.assert_allclose(pixels, expected, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(x=st.floats(80, 320), y=st.floats(30, 270), seed=st.integers(0, 1000))
def test_pixels_survive_the_world_and_back_in_any_pose(x: float, y: float, seed: int) -> None:
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    camera = replace(FISHEYE, R_world_camera=rotation * np.sign(np.linalg.det(rotation)))
    directions, valid = camera.unproject(np.array([x, y]))
    pixels, projected = camera.project(directions)
    assert valid == projected
    np.testing.assert_allclose(pixels, [x, y], atol=1e-9)


def test_validity_ends_at_the_valid_angle_the_circle_and_the_picture_edge() -> None:
    along_x = np.stack([np.arange(-1.0, 401.0, 0.25), np.full(1608, 149.5)], axis=1)

    def seen_from_to(camera: Calibration) -> tuple[float, float]:
        x = along_x[camera.unproject(along_x)[1], 0]
        return float(x.min()), float(x.max())

    # 93° is 90 · 93 π/180 = 146.08 px from the centre at 199.5.
    assert seen_from_to(FISHEYE) == (53.5, 345.5)
    circle = ImageCircle((200.0, 149.5), 100.0)
    assert seen_from_to(replace(FISHEYE, image_circle=circle)) == (100.0, 300.0)
    long_lens = replace(FISHEYE, model=Equidistant(CENTRE, 400.0))
    assert seen_from_to(long_lens) == (-0.5, 399.5)
    directions = long_lens.unproject(along_x)[0]
    np.testing.assert_array_equal(long_lens.project(directions)[1], long_lens.unproject(along_x)[1])


def test_the_middle_of_a_ring_is_unseen_within_the_inner_angle() -> None:
    ring = replace(FISHEYE, inner_angle_rad=np.radians(50.0))
    at = np.radians([0.0, 49.9, 50.0, 50.1, 92.9])
    directions = np.stack([np.sin(at), 0 * at, np.cos(at)], axis=-1)
    pixels, valid = ring.project(directions)
    assert valid.tolist() == [False, False, True, True, True]
    assert ring.unproject(pixels)[1].tolist() == valid.tolist()


def test_the_angles_of_a_mirror_ball_count_from_the_direction_back_to_the_camera() -> None:
    ball = Calibration(MirrorBall(CENTRE, 140.0, 8.0), SIZE, np.radians(100.0))
    back = LEVEL @ [0.0, 0.0, -1.0]
    at_99, at_101 = (
        np.cos(angle) * back + np.sin(angle) * (LEVEL @ [1.0, 0.0, 0.0])
        for angle in np.radians([99.0, 101.0])
    )
    directions = np.stack([back, at_99, at_101])
    np.testing.assert_allclose(ball.axis_angle(directions), np.radians([0, 99, 101]), atol=1e-12)
    np.testing.assert_array_equal(ball.project(directions)[1], [True, True, False])
    np.testing.assert_allclose(ball.unproject(np.array(CENTRE))[0], back, atol=1e-12)


def test_the_limit_of_the_model_holds_within_a_larger_valid_angle() -> None:
    camera = Calibration(KannalaBrandt(CENTRE, 90.0, -0.2), SIZE, np.pi)  # turns at 74°
    assert not camera.project(LEVEL @ [1.0, 0.0, 0.1])[1]


def test_uneven_vignetting_follows_the_camera_s_own_azimuth() -> None:
    # V = 1 − 0.2 θ² + 0.1 θ cos φ − 0.05 θ sin φ + 0.03 θ² cos 2φ + 0.02 θ² sin 2φ
    camera = replace(
        FISHEYE,
        R_world_camera=UP,
        vignetting=(-0.2,),
        uneven_vignetting=(0.1, -0.05, 0.03, 0.02),
    )
    angle = 0.5
    in_camera = [[np.sin(angle) * x, np.sin(angle) * y, np.cos(angle)] for x, y in AZIMUTHS]
    expected = [
        0.95 + 0.05 + 0.0075,  # φ = 0°, to the right
        0.95 - 0.025 - 0.0075,  # 90°, down
        0.95 - 0.05 + 0.0075,
        0.95 + 0.025 - 0.0075,
        0.95 + 0.025 * 0.5**0.5 + 0.005,  # 45°: cos 2φ = 0, sin 2φ = 1
    ]
    np.testing.assert_allclose(camera.illumination(np.array(in_camera) @ UP.T), expected)
    np.testing.assert_allclose(camera.illumination(UP[:, 2]), 1.0)


def test_relative_illumination_is_the_polynomial_in_the_squared_angle() -> None:
    camera = replace(FISHEYE, vignetting=(-0.2, 0.01))
    assert camera.relative_illumination(np.array(1.5)) == pytest.approx(
        1 - 0.2 * 1.5**2 + 0.01 * 1.5**4
    )
    np.testing.assert_array_equal(FISHEYE.relative_illumination(np.array([0.0, 1.0])), 1.0)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"image_size_px": (0, 3)}, "image_size_px"),
        ({"valid_angle_rad": 93.0}, "valid_angle_rad"),
        ({"valid_angle_rad": np.nan}, "valid_angle_rad"),
        ({"inner_angle_rad": 1.7}, "inner_angle_rad must be from 0 to less than valid_angle_rad"),
        ({"inner_angle_rad": -0.1}, "inner_angle_rad"),
        ({"R_world_camera": np.diag([1.0, 1.0, -1.0])}, "R_world_camera"),
        ({"R_world_camera": np.full((3, 3), np.nan)}, "R_world_camera"),
        ({"vignetting": (-0.5,)}, "vignetting"),
        ({"uneven_vignetting": (0.6, 0.6)}, "vignetting"),
        ({"uneven_vignetting": (0.1,)}, "2 or 4 numbers, got 1"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(changes, named) -> None:
    with pytest.raises(InputError, match=named):
        replace(FISHEYE, **changes)


def test_a_picture_of_another_size_is_refused() -> None:
    FISHEYE.check_size((400, 300), "photo.png")
    with pytest.raises(InputError, match=r"^photo\.png is 800×600 px .* 400×300.*× 2,") as same:
        FISHEYE.check_size((800, 600), "photo.png")
    assert "scale the calibration" in str(same.value)
    with pytest.raises(InputError, match="300×400") as other:
        FISHEYE.check_size((300, 400), "photo.png")
    assert "scale" not in str(other.value)


@pytest.mark.parametrize(
    "camera",
    [
        replace(FISHEYE, image_circle=ImageCircle((190.0, 150.0), 140.0)),
        Calibration(MirrorBall(CENTRE, 140.0, 8.0), SIZE, np.pi),
        Calibration(full_sphere(SIZE), SIZE, np.pi),
    ],
    ids=["fisheye", "ball", "equirectangular"],
)
def test_a_scaled_camera_sees_the_same_through_the_corners_of_its_pixels(
    camera: Calibration,
) -> None:
    half = camera.scaled_to((200, 150))
    # A pixel of the half-size picture covers four: their shared corner is its centre.
    own = np.stack(np.meshgrid(np.arange(0, 200, 7.0), np.arange(0, 150, 7.0)), axis=-1)
    directions, valid = half.unproject(own)
    expected, expected_valid = camera.unproject(2 * own + 0.5)
    np.testing.assert_array_equal(valid, expected_valid)
    np.testing.assert_allclose(directions, expected, atol=1e-12)
    assert half.image_size_px == (200, 150)


def test_a_resized_picture_is_told_how_to_scale_the_file() -> None:
    with pytest.raises(InputError) as refusal:
        FISHEYE.check_size((200, 150), "a.exr")
    assert "lengths in pixels × 0.5, centres to (x + ½) × 0.5 − ½" in str(refusal.value)
    x, y = FISHEYE.model.centre_px  # type: ignore[attr-defined]
    half = FISHEYE.scaled_to((200, 150)).model.centre_px  # type: ignore[attr-defined]
    assert half == ((x + 0.5) * 0.5 - 0.5, (y + 0.5) * 0.5 - 0.5)


def test_only_the_same_shape_can_be_scaled() -> None:
    large = replace(FISHEYE, image_size_px=(5616, 3744))
    assert large.scaled_to((1024, 683)).image_size_px == (1024, 683)  # 682.67 rounded
    with pytest.raises(InputError, match="shape"):
        large.scaled_to((1024, 690))
