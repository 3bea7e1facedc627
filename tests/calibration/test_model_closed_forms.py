"""Single camera models against what is known of them: solid angles, limits, traced mirrors."""

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from calibration.models.equisolid import Equisolid
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from calibration.models.orthographic import Orthographic
from calibration.models.stereographic import Stereographic
from tests.calibration.model_angles import CENTRE, angle_between, around_axis


def solid_angle_per_pixel(model: CameraModel, angle: float, step_px: float = 0.01) -> float:
    """dω/dA at a pixel by differences; the azimuth is that of no axis of symmetry."""
    pixel = model.project(around_axis(model, np.array(angle), np.array(0.7)))[0]
    offsets = step_px * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    right, left, down, up = model.unproject(pixel + offsets)[0]
    area = np.linalg.norm(np.cross(right - left, down - up))
    return float(area / (2 * step_px) ** 2)


@pytest.mark.parametrize("angle", np.radians([5.0, 40.0, 80.0, 110.0]))
def test_the_solid_angle_of_a_pixel_has_its_closed_form(angle: float) -> None:
    # dω/dA = sin θ / (r dr/dθ): derive with r = f θ, 2f sin(θ/2), 2f tan(θ/2), f sin θ.
    f = 200.0
    expected = {
        Equidistant: np.sin(angle) / angle,
        Equisolid: 1.0,
        Stereographic: np.cos(angle / 2) ** 4,
    }
    if angle < np.pi / 2:
        expected[Orthographic] = 1 / np.cos(angle)
    for model_type, relative in expected.items():
        measured = solid_angle_per_pixel(model_type(CENTRE, f), angle) * f**2
        assert measured == pytest.approx(relative, rel=1e-6)


def test_a_distant_mirror_ball_shows_equal_solid_angles() -> None:
    # The orthographic limit θ = 2 asin(r/R) has dω/dA = 4/R².
    ball = MirrorBall(CENTRE, 200.0, 1e7)
    for angle in np.radians([10.0, 90.0, 160.0]):
        assert solid_angle_per_pixel(ball, angle) == pytest.approx(4 / 200.0**2, rel=1e-4)


def test_equirectangular_pixels_shrink_with_the_cosine_of_latitude() -> None:
    model = full_sphere((640, 320))
    cell = (np.pi / 320) ** 2
    for y in (160.0, 250.0, 300.0):
        latitude = (y - 159.5) * np.pi / 320
        corners = np.array([[100.5, y], [99.5, y], [100.0, y + 0.5], [100.0, y - 0.5]])
        right, left, down, up = model.unproject(corners)[0]
        area = np.linalg.norm(np.cross(right - left, down - up))
        assert area == pytest.approx(cell * np.cos(latitude), rel=1e-4)


def test_equirectangular_seam_and_poles_are_ordinary() -> None:
    width, height = 640, 320
    model = full_sphere((width, height))
    corners = np.array([[-0.5, 159.5], [width - 0.5, 159.5], [0.0, -0.5], [7.0, height - 0.5]])
    directions, valid = model.unproject(corners)
    assert valid.all()
    expected = [[0, 0, -1], [0, 0, -1], [0, -1, 0], [0, 1, 0]]  # behind, behind, up, down
    np.testing.assert_allclose(directions, expected, atol=1e-12)
    outer = model.unproject(np.array([[0.0, 100.0], [width - 1.0, 100.0]]))[0]
    inner = model.unproject(np.array([[300.0, 100.0], [301.0, 100.0]]))[0]
    assert angle_between(*outer) == pytest.approx(angle_between(*inner), rel=1e-9)
    assert not model.unproject(np.array([[-0.51, 9.0], [9.0, height - 0.49]]))[1].any()


def test_kannala_brandt_agrees_with_opencv_where_opencv_is_right() -> None:
    import cv2

    terms = (0.03, -0.012, 0.003, -0.0004)
    fx, fy = 160.0, 158.0
    model = KannalaBrandt(CENTRE, (fx, fy), *terms)
    rng = np.random.default_rng(5)
    angle, azimuth = rng.uniform(0, np.radians(80), 200), rng.uniform(-np.pi, np.pi, 200)
    directions = around_axis(model, angle, azimuth)
    matrix = np.array([[fx, 0, CENTRE[0]], [0, fy, CENTRE[1]], [0, 0, 1]])
    theirs, _ = cv2.fisheye.projectPoints(
        directions[None], np.zeros(3), np.zeros(3), matrix, np.array(terms)
    )
    np.testing.assert_allclose(model.project(directions)[0], theirs[0], atol=1e-9)


def test_kannala_brandt_ends_where_the_radius_stops_growing() -> None:
    # dθ_d/dθ = 1 + 3 k1 θ² = 0 at θ = 1/√(−3 k1).
    assert KannalaBrandt(CENTRE, 1.0, -0.12).limit_angle_rad == pytest.approx(0.36**-0.5)
    assert KannalaBrandt(CENTRE, 1.0, 0.05).limit_angle_rad == np.pi
    # A last coefficient next to nothing, by which the others cannot be divided, changes nothing.
    assert KannalaBrandt(CENTRE, 1.0, -0.12, k4=1e-308).limit_angle_rad == pytest.approx(0.36**-0.5)
    # A root of the slope in θ² that is negative or complex bounds nothing.
    assert KannalaBrandt(CENTRE, 1.0, -0.1, 0.1).limit_angle_rad == np.pi


@pytest.mark.parametrize("ratio", [1.2, 3.0, 20.0])
def test_mirror_ball_agrees_with_ray_tracing(ratio: float) -> None:
    """Trace a camera ray to the sphere, reflect it, and compare: nothing of the formula is used."""
    radius_px = 150.0
    ball = MirrorBall(CENTRE, radius_px, ratio)
    rng = np.random.default_rng(3)
    radius, azimuth = rng.uniform(0, 0.999, 300), rng.uniform(-np.pi, np.pi, 300)
    offset = radius_px * radius[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    # Pinhole at the origin, ball of radius 1 at (0, 0, ratio): the outline is seen at
    # tan α = 1/√(ratio² − 1), which fixes the pinhole's focal length.
    focal_px = radius_px * np.sqrt(ratio**2 - 1)
    ray = np.concatenate([offset, np.full((300, 1), focal_px)], axis=1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    along = ratio * ray[:, 2]
    hit = ray * (along - np.sqrt(along**2 - (ratio**2 - 1)))[:, None]
    normal = hit - [0.0, 0.0, ratio]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-9)
    reflected = ray - 2 * np.sum(ray * normal, axis=1, keepdims=True) * normal
    directions, valid = ball.unproject(np.array(CENTRE) + offset)
    assert valid.all()
    np.testing.assert_allclose(directions, reflected, atol=1e-9)


def test_mirror_ball_is_blind_behind_itself() -> None:
    ball = MirrorBall(CENTRE, 100.0, 5.0)
    blind = np.arcsin(1 / 5.0)
    behind = around_axis(ball, np.pi - blind * np.array([0.0, 0.99, 1.01]), np.zeros(3))
    np.testing.assert_array_equal(ball.project(behind)[1], [False, False, True])
