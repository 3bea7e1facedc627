"""What every method of METHODS keeps to."""

from functools import cache

import numpy as np
import pytest

from calibration.response import METHODS, estimate_response
from calibration.response_samples import MOST_COUNT, sample_brackets
from capture.frame import Bracket, Exposure, Frame
from tests.calibration.response_scenes import CURVES, bracket, error_ev

WORST_RMS_EV = {"monotone": 0.002, "debevec": 0.08, "robertson": 0.12, "mitsunaga": 0.04}
"""On five exposures 2 EV apart; measured on the film-like curve 0.0003, 0.067, 0.101 and 0.027."""

METHOD_NAMES = pytest.mark.parametrize("method", METHODS)


@cache
def samples(name):
    return sample_brackets([bracket(name)])


@cache
def fitted(method, name):
    return METHODS[method](samples(name))


@METHOD_NAMES
@pytest.mark.parametrize("name", CURVES)
def test_a_curve_rises_from_black_to_white_and_channels_agree_in_the_middle(method, name):
    curve = fitted(method, name)
    assert (curve.values[0] == 0).all()
    assert (curve.values[MOST_COUNT + 1 :] == 1).all()
    assert (np.diff(curve.values, axis=0) >= 0).all()
    assert np.allclose(curve.values[128], curve.values[128, 0], rtol=1e-12)
    assert curve.values[MOST_COUNT].max() == 1.0


@METHOD_NAMES
@pytest.mark.parametrize("name", CURVES)
def test_the_true_curve_is_found(method, name):
    rms = np.sqrt(np.mean(error_ev(fitted(method, name), name) ** 2))
    assert rms <= WORST_RMS_EV[method]


@METHOD_NAMES
def test_exposures_agree_better_than_with_the_assumed_curve(method):
    response = estimate_response([bracket("film")], method)
    assert response.held_out_ev < 0.25 * response.assumed_ev
    assert response.patch_count == len(samples("film"))


@METHOD_NAMES
def test_neither_the_unit_of_time_nor_the_order_of_the_frames_matters(method):
    frames = [
        Frame(frame.counts, Exposure(frame.exposure.time_s / 1024.0), index=frame.index)
        for frame in reversed(bracket("film").frames)
    ]
    other = METHODS[method](sample_brackets([Bracket(tuple(frames))]))
    assert np.allclose(other.values, fitted(method, "film").values, rtol=1e-5, atol=1e-9)
