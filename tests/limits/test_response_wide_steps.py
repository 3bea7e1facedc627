"""Exposures far apart, and all in one ratio.

Claim    : a ripple of the curve with the exposures' ratio as its period is seen by no patch.
Setup    : the film-like curve, exposures 1, 2 and 3 EV apart over the same 9 EV; then 4 EV.
Expected : up to 3 EV within 0.01 stops rms, with the deviation growing; 4 EV is refused.
Measured : 0.0004, 0.0003 and 0.0016 stops rms. Real scenes of few smooth patches are worse: with
           5 EV steps the bundled recordings gave a ripple of up to six stops, before they were
           refused.
"""

import numpy as np
import pytest

from calibration.response_monotone import fit_monotone
from calibration.response_samples import sample_brackets
from capture.errors import InputError
from tests.calibration.response_scenes import bracket, error_ev, exposures


def rms_ev(step_ev):
    count = round(9 / step_ev) + 1
    samples = sample_brackets([bracket("film", times=exposures(count, step_ev))])
    return float(np.sqrt(np.mean(error_ev(fit_monotone(samples), "film") ** 2)))


def test_up_to_three_stops_apart_the_curve_is_found():
    errors = [rms_ev(step_ev) for step_ev in (1, 2, 3)]
    assert max(errors) < 0.01


def test_four_stops_apart_is_refused():
    with pytest.raises(InputError, match=r"4\.0 EV apart or more"):
        sample_brackets([bracket("film", times=exposures(3, 4.0))])
