"""Errors of directions: rotations taken out, covariance carried, against closed forms."""

import numpy as np
import pytest

from calibration.lens.uncertainty import (
    direction_covariance,
    direction_difference,
    fan,
    sigma_by_angle,
)
from calibration.models.equidistant import Equidistant
from calibration.models.kannala_brandt import KannalaBrandt

LENS = Equidistant((500.0, 400.0), 300.0)
AT = fan((0.0, np.deg2rad(80.0)), np.deg2rad(110.0))


def test_a_rotation_of_all_directions_is_no_error() -> None:
    turned = np.cross([1e-3, -2e-3, 5e-4], AT.directions)
    along = np.einsum("ajc,ajck->ajk", turned, AT.tangents)
    assert np.abs(AT.without_rotation(along)).max() < 1e-15
    assert np.abs(along).max() > 1e-3


def test_a_focal_length_off_by_a_share_stretches_all_angles_by_it() -> None:
    # r = f θ: at the same pixel θ' = θ f / f', outward on every azimuth, which no rotation undoes.
    off = Equidistant(LENS.centre_px, 303.0)
    difference = direction_difference(off, LENS, AT)
    expected = AT.angle_rad * (300.0 / 303.0 - 1.0)
    np.testing.assert_allclose(difference[..., 0], np.sin(expected)[:, None] + 0 * AT.weight)
    np.testing.assert_allclose(difference[..., 1], 0.0, atol=1e-12)


def test_uncertainty_of_the_focal_length_is_that_of_angles() -> None:
    free = np.array([False, False, True])
    covariance = direction_covariance(LENS, free, np.array([[0.25]]), AT)
    np.testing.assert_allclose(sigma_by_angle(covariance), AT.angle_rad * 0.5 / 300.0)


def test_uncertainty_of_the_centre_is_mostly_a_rotation() -> None:
    # A shift of the centre by δ px turns directions near the axis by δ / f; further out it is less
    # a rotation, so that something is left and grows.
    free = np.array([True, True, False])
    sigma = sigma_by_angle(direction_covariance(LENS, free, np.eye(2), AT))
    assert sigma[0] < 0.1 / 300.0
    assert sigma[-1] > 0.5 / 300.0


def test_beyond_the_models_limit_nothing_is_sure() -> None:
    ends = KannalaBrandt((500.0, 400.0), 300.0, -0.2)  # θ − 0.2 θ³ grows up to √(1/0.6) = 1.29 rad
    free = np.ones(7, np.bool_)
    sigma = sigma_by_angle(direction_covariance(ends, free, np.eye(7) * 1e-6, AT))
    assert np.all(np.isfinite(sigma) == (AT.angle_rad < ends.limit_angle_rad))


def test_predicted_covariance_is_that_of_many_noisy_lenses() -> None:
    random = np.random.default_rng(0)
    root = np.diag([0.3, 0.3, 0.4])
    free = np.ones(3, np.bool_)
    predicted = direction_covariance(LENS, free, root @ root, AT)
    values = np.array([500.0, 400.0, 300.0]) + random.normal(size=(400, 3)) @ root
    errors = np.array(
        [direction_difference(Equidistant((x, y), f), LENS, AT)[::16, ::4] for x, y, f in values]
    )
    found = np.einsum("najk,najl->ajkl", errors, errors) / len(values)
    scale = np.trace(predicted[::16, ::4], axis1=-2, axis2=-1)[..., None, None]
    np.testing.assert_allclose(found / scale, predicted[::16, ::4] / scale, atol=0.12)
    assert found.max() == pytest.approx(predicted[::16, ::4].max(), rel=0.15)
