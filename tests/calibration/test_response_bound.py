"""The least step onto bounds."""

import numpy as np
import pytest

from calibration.response_bound import least_step


def test_one_bound_is_met_where_the_closed_form_says():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(5, 5))
    covariance, bound = root @ root.T, rng.normal(size=5)
    # The conditional mean of a normal distribution given bound·x = 2.
    expected = covariance @ bound * 2.0 / (bound @ covariance @ bound)
    assert least_step(covariance, bound[None], np.array([2.0])) == pytest.approx(expected)


def test_all_bounds_hold_and_no_shorter_step_does():
    rng = np.random.default_rng(1)
    bound, missing = rng.normal(size=(4, 6)), np.array([1.0, 0.5, -1.0, 0.2])
    step = least_step(np.eye(6), bound, missing)
    assert (bound @ step >= missing - 1e-9).all()
    # Optimal: the step is a sum of the bounds that it just meets, none with a negative share.
    met = bound @ step < missing + 1e-9
    shares = np.linalg.lstsq(bound[met].T, step, rcond=None)[0]
    assert bound[met].T @ shares == pytest.approx(step)
    assert (shares >= 0).all()
