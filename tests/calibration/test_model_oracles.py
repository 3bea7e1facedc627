"""Camera models against what was published or other programs compute."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from calibration.models.double_sphere import DoubleSphere
from calibration.models.equidistant import Equidistant
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.ocam import OCam, from_ocamcalib
from calibration.models.orthographic import Orthographic
from calibration.models.parameters import parameters, with_parameters
from calibration.models.splined_radial import SplinedRadial
from calibration.models.stereographic import Stereographic
from calibration.models.unified import Unified
from capture.errors import InputError

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
CENTRE = (365.8, 249.4)


def rays(limit_rad: float, count: int = 300) -> NDArray[np.float64]:
    """Directions of several lengths, up to an angle from the axis."""
    rng = np.random.default_rng(17)
    angle, azimuth = rng.uniform(0, limit_rad, count), rng.uniform(-np.pi, np.pi, count)
    flat = np.sin(angle)[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    return np.column_stack([flat, np.cos(angle)]) * rng.uniform(0.2, 5.0, count)[:, None]


def test_kannala_brandt_inverts_its_polynomial_to_rounding() -> None:
    terms = (0.03, -0.012, 0.003, -0.0004)
    model = KannalaBrandt((0.0, 0.0), 1.0, *terms)
    angle = np.linspace(0.0, 0.999 * model.limit_angle_rad, 5000)
    radius = np.polynomial.polynomial.polyval(angle**2, [1.0, *terms]) * angle
    directions, valid = model.unproject(np.stack([radius, np.zeros_like(radius)], axis=-1))
    assert valid.all()
    returned = np.arctan2(directions[:, 0], directions[:, 2])
    np.testing.assert_allclose(returned, angle, atol=1e-13)


def test_unified_agrees_with_opencv() -> None:
    fx, fy, xi, distortion = 320.0, 318.0, 1.5, (-0.03, 0.002, 3e-4, -2e-4)
    model = Unified(CENTRE, (fx, fy), xi, *distortion)
    directions = rays(np.radians(115.0))
    matrix = np.array([[fx, 0, CENTRE[0]], [0, fy, CENTRE[1]], [0, 0, 1]])
    theirs, _ = cv2.omnidir.projectPoints(
        directions[None], np.zeros(3), np.zeros(3), matrix, xi, np.array(distortion)
    )
    pixels, valid = model.project(directions)
    assert valid.all()
    np.testing.assert_allclose(pixels, theirs.reshape(-1, 2), atol=1e-9)


def test_double_sphere_agrees_with_its_paper() -> None:
    fx, fy, xi, alpha = 348.1, 347.1, -0.2443, 0.5657
    model = DoubleSphere(CENTRE, (fx, fy), xi, alpha)
    directions = rays(np.radians(175.0))
    x, y, z = directions.T
    d1 = np.sqrt(x**2 + y**2 + z**2)
    d2 = np.sqrt(x**2 + y**2 + (xi * d1 + z) ** 2)
    depth = alpha * d2 + (1 - alpha) * (xi * d1 + z)
    w1 = (1 - alpha) / alpha
    w2 = (w1 + xi) / np.sqrt(2 * w1 * xi + xi**2 + 1)
    pixels, valid = model.project(directions)
    assert valid[z > -w2 * d1].all()  # their bound is sufficient, ours is where the radius turns
    np.testing.assert_array_equal(valid, xi * d1 + z > -w1 * d2)
    assert 0.3 < valid.mean() < 0.9
    expected = np.array(CENTRE) + np.stack([fx * x / depth, fy * y / depth], axis=-1)
    np.testing.assert_allclose(pixels[valid], expected[valid], atol=1e-9)


def test_extended_unified_agrees_with_its_paper() -> None:
    fx, fy, alpha, beta = 460.9, 459.6, 0.5865, 1.1392
    model = ExtendedUnified(CENTRE, (fx, fy), alpha, beta)
    x, y, z = rays(np.radians(120.0)).T
    depth = alpha * np.sqrt(beta * (x**2 + y**2) + z**2) + (1 - alpha) * z
    expected = np.array(CENTRE) + np.stack([fx * x / depth, fy * y / depth], axis=-1)
    pixels, valid = model.project(np.stack([x, y, z], axis=-1))
    assert valid.all()
    np.testing.assert_allclose(pixels, expected, atol=1e-9)


def test_sphere_models_contain_each_other_and_the_classic_lenses() -> None:
    directions = rays(np.radians(89.0))
    xi, f = 0.8, 200.0
    alpha = xi / (1 + xi)
    unified = Unified(CENTRE, f * (1 + xi), xi).project(directions)[0]
    for other in (
        ExtendedUnified(CENTRE, f, alpha, 1.0),
        DoubleSphere(CENTRE, f, 0.0, alpha),
    ):
        np.testing.assert_allclose(other.project(directions)[0], unified, atol=1e-9)
    for alpha, classic in ((0.5, Stereographic(CENTRE, f)), (1.0, Orthographic(CENTRE, f))):
        pixels = classic.project(directions)[0]
        model = ExtendedUnified(CENTRE, f, alpha, 1.0)
        np.testing.assert_allclose(model.project(directions)[0], pixels, atol=1e-9)
        returned = model.unproject(pixels)[0]
        expected = classic.unproject(pixels)[0]
        np.testing.assert_allclose(returned, expected, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(alpha=st.floats(0.0, 1.5), beta=st.floats(0.2, 4.0), share=st.floats(0.0, 0.999))
def test_the_ellipsoid_has_one_radius_for_an_angle_up_to_its_limit(alpha, beta, share) -> None:
    model = ExtendedUnified((0.0, 0.0), 1.0, alpha, beta)
    angle = share * np.linspace(0.0, model.limit_angle_rad, 50)
    directions = np.stack([np.sin(angle), np.zeros(50), np.cos(angle)], axis=-1)
    pixels, valid = model.project(directions)
    assert valid.all()
    assert np.all(np.diff(pixels[:, 0]) >= 0)
    returned, seen = model.unproject(pixels)
    assert seen.all()
    # Where the radius hardly grows, rounding in it is multiplied by dθ/dr: √ε at the very limit.
    np.testing.assert_allclose(np.arctan2(returned[:, 0], returned[:, 2]), angle, atol=1e-9)


@pytest.mark.parametrize("alpha", [0.8, 1.0, 1.25, 1.5])
def test_the_ellipsoid_is_inverted_where_the_usual_form_is_0_over_0(alpha: float) -> None:
    # 1 = α² β ρ² is θ = 90° up to α = 1, and the last angles of narrower lenses above.
    model = ExtendedUnified((0.0, 0.0), 1.0, alpha, 1.0)
    pixel = np.array([1.0 / alpha, 0.0])
    direction, valid = model.unproject(pixel)
    assert valid
    assert np.arctan2(direction[0], direction[2]) <= np.pi / 2 + 1e-12
    np.testing.assert_allclose(model.project(direction)[0], pixel, atol=1e-9)


def ocamcalib_ray(polynomial, centre, c, d, e, row, column) -> NDArray[np.float64]:
    """Return the toolbox's ray (row, column, backward) of a pixel, as its cam2world computes it."""
    inverse = 1.0 / (c - d * e)
    x = inverse * ((row - centre[0]) - d * (column - centre[1]))
    y = inverse * (-e * (row - centre[0]) + c * (column - centre[1]))
    z = np.polynomial.polynomial.polyval(np.hypot(x, y), polynomial)
    ray = np.stack([x, y, z], axis=-1)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)


def check_against_ocamcalib(polynomial, centre, affine, size) -> None:
    model = from_ocamcalib(polynomial, centre, *affine)
    row, column = np.random.default_rng(2).uniform(0, 1, (2, 400)) * np.reshape(size, (2, 1))
    theirs = ocamcalib_ray(polynomial, centre, *affine, row, column)
    pixels = np.stack([column, row], axis=-1)
    directions, valid = model.unproject(pixels)
    assert valid.all()
    # Theirs is (down, right, backward), ours (right, down, forward).
    np.testing.assert_allclose(directions, theirs[:, [1, 0, 2]] * [1, 1, -1], atol=1e-12)
    np.testing.assert_allclose(model.project(directions)[0], pixels, atol=1e-7)


def test_ocam_agrees_with_the_toolbox() -> None:
    polynomial = (-209.3037, 0.0, 2.216175e-03, -5.122558e-06, 2.149945e-08)
    affine = (0.998870, -0.0169, 0.0110)
    check_against_ocamcalib(polynomial, (243.611488, 359.829671), affine, (480, 752))


@pytest.mark.data
def test_a_file_of_the_ocam_toolbox_agrees_with_it() -> None:
    path = DATA / "calib-ocam-vmr-sample/calib_results_fisheye.txt"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    lines = [line for line in path.read_text().splitlines() if line and line[0] != "#"]
    direct, _, centre, affine, size = ([float(word) for word in line.split()] for line in lines)
    check_against_ocamcalib(tuple(direct[1:]), tuple(centre), tuple(affine), size)


def test_a_polynomial_that_is_not_ocamcalibs_is_refused() -> None:
    for polynomial in ((200.0, 0.0, -1e-3), (-200.0, 0.1, 1e-3), (-200.0,)):
        with pytest.raises(InputError, match="OCamCalib"):
            from_ocamcalib(polynomial, (0.0, 0.0))


def test_a_spline_without_deviations_is_equidistant() -> None:
    directions = rays(np.radians(109.0))
    expected = Equidistant(CENTRE, 150.0).project(directions)[0]
    model = SplinedRadial(CENTRE, 150.0, np.radians(110.0), (0.0,) * 6)
    np.testing.assert_allclose(model.project(directions)[0], expected, atol=1e-10)


def test_the_spline_agrees_with_scipy() -> None:
    end, deviations = 1.9, (0.01, 0.03, 0.02, -0.03, -0.1)
    step = end / len(deviations)
    knots = step * np.arange(-3, len(deviations) + 4)
    spline = BSpline(knots, [0.0, 0.0, 0.0, *deviations], 3)
    angle = np.linspace(0.0, end, 200)
    directions = np.stack([np.sin(angle), np.zeros(200), np.cos(angle)], axis=-1)
    pixels, _ = SplinedRadial((0.0, 0.0), 1.0, end, deviations).project(directions)
    np.testing.assert_allclose(pixels[:, 0], angle + spline(angle), atol=1e-13)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-1.0, 0.4), min_size=1, max_size=9))
def test_a_spline_ends_where_its_radius_first_stops_growing(deviations) -> None:
    model = SplinedRadial((0.0, 0.0), 1.0, 2.0, tuple(deviations))
    limit = model.limit_angle_rad
    angle = np.linspace(0.0, limit, 400)
    directions = np.stack([np.sin(angle), np.zeros(400), np.cos(angle)], axis=-1)
    radius = model.project(directions[:-1])[0][:, 0]
    assert np.all(np.diff(radius) > 0)
    if limit < 2.0:
        last = (1 - 1e-9) * limit
        rim = np.array([np.sin(last), 0.0, np.cos(last)])
        outward = np.array([np.cos(last), 0.0, -np.sin(last)])
        assert abs(model.project_jacobian(rim)[0][0] @ outward) < 1e-6


def test_parameters_are_the_fields_one_by_one() -> None:
    model = OCam((1.0, 2.0), (3.0, 4.0), (5.0, 6.0, 7.0), 8.0, 9.0, 0.5)
    np.testing.assert_array_equal(parameters(model), [1, 2, 3, 4, 5, 6, 7, 8, 9, 0.5])
    square = with_parameters(Equidistant((0.0, 0.0), 1.0), np.array([7.0, 8.0, 9.0]))
    assert square == Equidistant((7.0, 8.0), 9.0)
    with pytest.raises(InputError, match="focal_px"):
        with_parameters(square, np.array([7.0, 8.0, -9.0]))
