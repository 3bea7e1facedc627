"""What every camera model keeps to.

The reach of a model is the angle from its axis to which its round trips are tested: short of the
limit where the radius turns (orthographic, Kannala-Brandt, mirror ball), because there rounding in
the pixel is multiplied by dθ/dr → ∞ whatever the code.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from calibration.camera import Calibration, CameraModel
from calibration.models import MODELS
from calibration.models.double_sphere import DoubleSphere
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from calibration.models.equisolid import Equisolid
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from calibration.models.mirror_ball_off_axis import MirrorBallOffAxis
from calibration.models.ocam import OCam
from calibration.models.orthographic import Orthographic
from calibration.models.parameters import parameters, with_parameters
from calibration.models.splined_radial import SplinedRadial
from calibration.models.stereographic import Stereographic
from calibration.models.unified import Unified
from capture.errors import InputError
from tests.calibration.model_angles import CENTRE, angle_between, around_axis


@dataclass(frozen=True)
class Case:
    """A model, the angle from its axis to which it is tested, and how far its x and y mix."""

    model: CameraModel
    reach_rad: float
    shear: float = 1e-13


CASES = {
    "equidistant": Case(Equidistant(CENTRE, 150.0), np.radians(179.9)),
    "equidistant, oblong pixels": Case(Equidistant(CENTRE, (150.0, 141.0)), np.radians(179.9)),
    "equisolid": Case(Equisolid(CENTRE, 180.0), np.radians(179.0)),
    "stereographic": Case(Stereographic(CENTRE, (120.0, 125.0)), np.radians(175.0)),
    "orthographic": Case(Orthographic(CENTRE, 200.0), np.radians(89.9)),
    "Kannala-Brandt, no terms": Case(KannalaBrandt(CENTRE, 150.0), np.radians(179.9)),
    "Kannala-Brandt, 220° lens": Case(
        KannalaBrandt(CENTRE, (160.0, 158.0), 0.03, -0.012, 0.003, -0.0004), np.radians(110.0)
    ),
    "Kannala-Brandt, turning": Case(KannalaBrandt(CENTRE, 150.0, -0.12), np.radians(94.0)),
    "OCam, 220° lens": Case(
        OCam(CENTRE, 210.0, (-0.47, 0.24, -0.2), 0.9989, -0.0017, 0.0011), np.radians(110.0), 2e-3
    ),
    "OCam, oblong pixels": Case(OCam(CENTRE, (160.0, 155.0), (-0.4,)), np.radians(140.0)),
    "OCam, turning": Case(OCam(CENTRE, 150.0, (-0.8, 0.2)), np.radians(100.0)),
    "unified, 220° lens": Case(
        Unified(CENTRE, (320.0, 318.0), 1.5, -0.03, 0.002, 3e-4, -2e-4), np.radians(110.0), 1e-3
    ),
    "unified, folding": Case(
        Unified(CENTRE, 300.0, 0.9, -0.05, 0.0, -2e-3, 1e-3), np.radians(105.0), 1e-3
    ),
    "unified, unbounded": Case(Unified(CENTRE, 200.0, 0.4), np.radians(110.0)),
    "extended unified, 220° lens": Case(
        ExtendedUnified(CENTRE, (150.0, 151.0), 0.6, 1.1), np.radians(120.0)
    ),
    "extended unified, unbounded": Case(
        ExtendedUnified(CENTRE, 150.0, 0.3, 0.9), np.radians(112.0)
    ),
    "extended unified, stereographic": Case(
        ExtendedUnified(CENTRE, 99.0, 0.5, 1.0), np.radians(175)
    ),
    "extended unified, narrow": Case(ExtendedUnified(CENTRE, 1300.0, 1.02, 1.0), np.radians(85.0)),
    "double sphere, 220° lens": Case(
        DoubleSphere(CENTRE, (130.0, 131.0), -0.25, 0.57), np.radians(118.0)
    ),
    "double sphere, unbounded": Case(DoubleSphere(CENTRE, 150.0, 0.3, 0.4), np.radians(130.0)),
    "splined radial, 220° lens": Case(
        SplinedRadial(CENTRE, (160.0, 159.0), 1.95, (0.004, 0.01, 0.03, 0.02, -0.03, -0.1, -0.3)),
        np.radians(110.0),
    ),
    "splined radial, turning": Case(
        SplinedRadial(CENTRE, 150.0, 3.0, (0.0, -0.2, -1.0, -2.5)), np.radians(90.0)
    ),
    "mirror ball, near": Case(MirrorBall(CENTRE, 200.0, 1.5), np.radians(138.0)),
    "mirror ball": Case(MirrorBall(CENTRE, 200.0, 6.0), np.radians(170.0)),
    "mirror ball, far": Case(MirrorBall(CENTRE, 200.0, 1e6), np.radians(179.0)),
    "mirror ball, off axis": Case(
        MirrorBallOffAxis(CENTRE, (-150.0, 330.0), 1200.0, 6.0), np.radians(165.0), 0.2
    ),
    "mirror ball, oblong pixels": Case(
        MirrorBallOffAxis(CENTRE, (300.0, 20.0), (900.0, 880.0), 4.0), np.radians(160.0), 0.2
    ),
    "equirectangular": Case(full_sphere((640, 320)), np.radians(179.9)),
}
every_camera = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def test_every_model_is_tested() -> None:
    assert {case.model.name for case in CASES.values()} == set(MODELS)
    assert all(MODELS[case.model.name] is type(case.model) for case in CASES.values())


@every_camera
@settings(max_examples=40, deadline=None)
@given(share=st.floats(0.0, 1.0), azimuth=st.floats(-np.pi, np.pi))
def test_a_direction_survives_projection_and_back(case: Case, share: float, azimuth: float) -> None:
    direction = around_axis(case.model, np.array(share * case.reach_rad), np.array(azimuth))
    pixel, projected = case.model.project(direction)
    returned, valid = case.model.unproject(pixel)
    assert projected
    assert valid
    assert angle_between(direction, returned) < 1e-9


@every_camera
def test_a_pixel_survives_unprojection_and_back(case: Case) -> None:
    angle, azimuth = np.meshgrid(
        np.linspace(0.01, case.reach_rad, 41), np.linspace(-3.0, 3.1, 23), indexing="ij"
    )
    pixels, _ = case.model.project(around_axis(case.model, angle, azimuth))
    directions, valid = case.model.unproject(pixels)
    returned, projected = case.model.project(directions)
    assert valid.all()
    assert projected.all()
    np.testing.assert_allclose(returned, pixels, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, atol=1e-14)


@every_camera
@pytest.mark.parametrize("spread_px", [100.0, 1000.0, 1e5])
def test_a_pixel_that_is_seen_is_where_its_direction_lands(case: Case, spread_px: float) -> None:
    pixels = CENTRE + spread_px * np.random.default_rng(7).normal(size=(2000, 2))
    directions, valid = case.model.unproject(pixels)
    returned, projected = case.model.project(directions)
    np.testing.assert_array_equal(projected, valid)
    np.testing.assert_allclose(returned[valid], pixels[valid], rtol=1e-6, atol=1e-6)
    angle = np.arctan2(np.hypot(*directions[valid, :2].T), case.model.axis_z * directions[valid, 2])
    assert np.all(angle <= case.model.limit_angle_rad + 1e-12)


@every_camera
def test_the_axis_lands_on_the_centre(case: Case) -> None:
    pixel, valid = case.model.project(np.array([0.0, 0.0, case.model.axis_z]))
    assert valid
    centre = (319.5, 159.5) if case.model.name == "equirectangular" else CENTRE
    np.testing.assert_allclose(pixel, centre, atol=1e-12)


@every_camera
def test_right_in_the_picture_is_plus_x_and_down_is_plus_y(case: Case) -> None:
    centre = case.model.project(np.array([0.0, 0.0, case.model.axis_z]))[0]
    directions, _ = case.model.unproject(centre + 5.0 * np.eye(2))
    assert directions[0, 0] > 0
    assert directions[1, 1] > 0
    assert abs(directions[0, 1]) <= case.shear * directions[0, 0]
    assert abs(directions[1, 0]) <= case.shear * directions[1, 1]


@every_camera
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(), (1,), (0,), (7, 5)])
def test_any_leading_shape_and_float_type(case: Case, shape: tuple[int, ...], dtype: type) -> None:
    direction = np.array([0.1, -0.2, case.model.axis_z], dtype)
    directions = np.broadcast_to(direction, (*shape, 3))
    pixels, valid = case.model.project(directions)
    assert (pixels.shape, valid.shape) == ((*shape, 2), shape)
    assert (pixels.dtype, valid.dtype) == (np.float64, np.bool_)
    returned, valid = case.model.unproject(pixels.astype(dtype))
    assert (returned.shape, valid.shape) == ((*shape, 3), shape)
    assert (returned.dtype, valid.dtype) == (np.float64, np.bool_)
    assert valid.all()


@every_camera
def test_the_length_of_a_direction_does_not_matter(case: Case) -> None:
    direction = np.array([0.3, -0.2, 0.9 * case.model.axis_z])
    expected = case.model.project(direction)[0]
    np.testing.assert_allclose(case.model.project(direction * 1e-9)[0], expected, rtol=1e-12)
    np.testing.assert_allclose(case.model.project(direction * 1e9)[0], expected, rtol=1e-12)


@every_camera
def test_what_is_no_direction_or_pixel_is_invalid(case: Case) -> None:
    z = case.model.axis_z
    no_directions = np.array([[np.nan, 0, z], [0, np.inf, z], [0.0, 0.0, 0.0], [0.1, 0.1, z]])
    pixels, valid = case.model.project(no_directions)
    np.testing.assert_array_equal(valid, [False, False, False, True])
    np.testing.assert_array_equal(np.isnan(pixels).all(axis=-1), ~valid)
    directions, valid = case.model.unproject(np.array([[np.nan, 2.0], [2.0, np.nan], pixels[3]]))
    np.testing.assert_array_equal(valid, [False, False, True])
    np.testing.assert_array_equal(np.isnan(directions).all(axis=-1), ~valid)


def rim_radius_px(model: CameraModel) -> float:
    edge = around_axis(model, np.array(model.limit_angle_rad - 1e-9), np.array(0.0))
    return float(np.linalg.norm(model.project(edge)[0] - CENTRE))


LIMITED = {
    name: case
    for name, case in CASES.items()
    if case.model.limit_angle_rad < 3.1 and rim_radius_px(case.model) < 1e4
}


@pytest.mark.parametrize("case", LIMITED.values(), ids=LIMITED.keys())
def test_validity_ends_at_the_rim(case: Case) -> None:
    limit = case.model.limit_angle_rad
    angle = limit + np.array([-1e-6, -1e-12, 1e-6])
    (inside, rim, _), valid = case.model.project(around_axis(case.model, angle, np.zeros(3)))
    np.testing.assert_array_equal(valid, [True, True, False])
    assert case.model.unproject(inside)[1]
    assert not case.model.unproject(rim + np.array([0.01, 0.0]))[1]


def off_axis(case: Case, count: int = 60) -> NDArray[np.float64]:
    """Directions of several lengths within reach, off the axis and an equirectangular pole."""
    rng = np.random.default_rng(11)
    angle = rng.uniform(0.02, 0.98 * case.reach_rad, count)
    directions = around_axis(case.model, angle, rng.uniform(-1.2, 1.2, count))
    return directions * rng.uniform(0.5, 3.0, count)[:, None]


@every_camera
def test_the_jacobian_by_the_direction_is_that_of_differences(case: Case) -> None:
    directions, step = off_axis(case), 1e-6
    by_direction, _ = case.model.project_jacobian(directions)
    assert by_direction.shape == (len(directions), 2, 3)
    for component in range(3):
        offset = step * np.eye(3)[component]
        ahead, behind = (case.model.project(directions + sign * offset)[0] for sign in (1, -1))
        differences = (ahead - behind) / (2 * step)
        scale = np.linalg.norm(by_direction, axis=(1, 2))[:, None]
        assert np.max(np.abs(by_direction[..., component] - differences) / scale) < 1e-6
    # The length of a direction does not matter.
    along = by_direction @ directions[..., None]
    np.testing.assert_allclose(along, 0.0, atol=1e-9 * np.abs(by_direction).max())


@every_camera
def test_the_jacobian_by_the_parameters_is_that_of_differences(case: Case) -> None:
    directions, values = off_axis(case), parameters(case.model)
    _, by_parameters = case.model.project_jacobian(directions)
    assert by_parameters.shape == (len(directions), 2, len(values))
    for index, value in enumerate(values):
        step = 1e-6 * max(abs(value), 1.0)
        offset = step * np.eye(len(values))[index]
        pixels = [
            with_parameters(case.model, values + sign * offset).project(directions)[0]
            for sign in (1, -1)
        ]
        differences = (pixels[0] - pixels[1]) / (2 * step)
        seen = np.isfinite(differences).all(axis=-1)  # a step of the limit may hide a few
        assert seen.mean() > 0.9
        scale = 1.0 + np.abs(differences[seen]).max()
        errors = np.abs(by_parameters[seen, :, index] - differences[seen])
        assert errors.max() / scale < 1e-6, index


@every_camera
def test_the_jacobian_holds_on_the_axis(case: Case) -> None:
    axis, step = np.array([0.0, 0.0, 2.0 * case.model.axis_z]), 1e-5
    by_direction, by_parameters = case.model.project_jacobian(axis)
    ahead, behind = (case.model.project(axis + sign * step * np.eye(3))[0] for sign in (1, -1))
    differences = ((ahead - behind) / (2 * step)).T
    np.testing.assert_allclose(by_direction, differences, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(by_parameters[:, :2], np.eye(2), atol=1e-12)
    np.testing.assert_allclose(by_parameters[:, 2:], 0.0, atol=1e-9)


@every_camera
def test_there_is_no_jacobian_where_nothing_is_seen(case: Case) -> None:
    directions = np.zeros((2, 3, 3))
    directions[1] = [0.1, -0.2, case.model.axis_z]
    count = len(parameters(case.model))
    by_direction, by_parameters = case.model.project_jacobian(directions)
    assert (by_direction.shape, by_parameters.shape) == ((2, 3, 2, 3), (2, 3, 2, count))
    assert np.isnan(by_direction[0]).all()
    assert np.isnan(by_parameters[0]).all()
    assert np.isfinite(by_direction[1]).all()
    assert np.isfinite(by_parameters[1]).all()
    opposite = np.array([0.0, 0.0, -case.model.axis_z])
    if case.model.name != "equirectangular":  # whose axis is no singular direction
        assert np.isnan(case.model.project_jacobian(opposite)[0]).all()


@every_camera
def test_a_model_is_built_again_from_its_parameters(case: Case) -> None:
    values = parameters(case.model)
    assert with_parameters(case.model, values) == case.model
    changed = with_parameters(case.model, values * (1 + 1e-6))
    np.testing.assert_array_equal(parameters(changed), values * (1 + 1e-6))


@every_camera
def test_a_model_scales_with_its_picture(case: Case) -> None:
    camera = Calibration(case.model, (640, 480), case.reach_rad)
    half = camera.scaled_to((320, 240))
    pixels = np.array([[100.0, 200.0], [350.0, 170.0], CENTRE])
    expected, seen = case.model.unproject(pixels)
    directions, valid = half.model.unproject((pixels + 0.5) / 2 - 0.5)
    np.testing.assert_array_equal(valid, seen)
    assert seen[1]
    np.testing.assert_allclose(directions, expected, atol=1e-12)


FISHEYES = [
    name
    for name in CASES
    if "220° lens" in name or name in ("equidistant", "equisolid", "stereographic")
]


def test_a_fisheye_sees_past_90_degrees_outside_its_90_degree_circle() -> None:
    for name in FISHEYES:
        model = CASES[name].model
        at_90 = model.project(np.array([1.0, 0.0, 0.0]))[0]
        beyond = model.project(around_axis(model, np.radians(100.0), np.array(0.0)))[0]
        assert beyond[0] > at_90[0] > CENTRE[0]


@pytest.mark.parametrize(
    ("build", "named"),
    [
        (lambda: Equidistant((np.nan, 0.0), 1.0), "centre_px"),
        (lambda: Equisolid(CENTRE, 0.0), "focal_px"),
        (lambda: Stereographic(CENTRE, (1.0, -1.0)), "focal_px"),
        (lambda: KannalaBrandt(CENTRE, 1.0, k3=np.inf), "k1"),
        (lambda: OCam(CENTRE, 1.0, (np.nan,)), "coefficients"),
        (lambda: OCam(CENTRE, 1.0, (0.0,), -1.0), "mirrored"),
        (lambda: Unified(CENTRE, 1.0, -1.0), "xi"),
        (lambda: Unified(CENTRE, 1.0, 1.0, p2=np.inf), "p2"),
        (lambda: ExtendedUnified(CENTRE, 1.0, -0.1, 1.0), "alpha"),
        (lambda: ExtendedUnified(CENTRE, 1.0, 0.5, 0.0), "beta"),
        (lambda: DoubleSphere(CENTRE, 1.0, 1.0, 0.5), "xi"),
        (lambda: DoubleSphere(CENTRE, 1.0, 0.1, np.nan), "alpha"),
        (lambda: SplinedRadial(CENTRE, 1.0, 3.2, (0.0,)), "end_angle_rad"),
        (lambda: SplinedRadial(CENTRE, 1.0, 2.0, ()), "deviations"),
        (lambda: SplinedRadial(CENTRE, 1.0, 2.0, (np.inf,)), "deviations"),
        (lambda: MirrorBall(CENTRE, -1.0, 2.0), "radius_px"),
        (lambda: MirrorBall(CENTRE, 1.0, 1.0), "distance_ratio"),
        (lambda: MirrorBallOffAxis(CENTRE, CENTRE, 9.0, 1.0), "distance_ratio"),
        (lambda: MirrorBallOffAxis(CENTRE, (np.nan, 0.0), 9.0, 2.0), "principal_px"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(build, named) -> None:
    with pytest.raises(InputError, match=named):
        build()
