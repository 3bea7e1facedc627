"""A camera that changes its curve from exposure to exposure ("auto lighting", local tone mapping).

Claim    : no one curve explains such brackets; what comes out is an average that fits none of them.
Setup    : five exposures 2 EV apart; the two longest on a curve of gamma 1.8, the others on 2.2.
Expected : the held-out error and the deviation say so: each more than five times that of a camera
           of one curve.
Measured : held-out error 0.006 EV with one curve, 0.26 with two; deviation at count 64 0.0004 and
           0.12 of the value.
"""

from calibration.response import estimate_response
from capture.frame import Bracket
from tests.calibration.response_scenes import COUNTS, CURVES, bracket


def test_the_held_out_error_and_the_deviation_tell_it(monkeypatch):
    steady = bracket("gamma")
    monkeypatch.setitem(CURVES, "other", COUNTS**1.8)
    frames = (*steady.frames[:3], *bracket("other").frames[3:])
    one, two = estimate_response([steady]), estimate_response([Bracket(frames)])

    def doubt(response):
        return (response.curve.deviation[64] / response.curve.values[64]).max()

    assert two.held_out_ev > 5 * one.held_out_ev
    assert doubt(two) > 5 * doubt(one)
