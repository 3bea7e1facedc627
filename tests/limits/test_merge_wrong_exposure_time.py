"""Claim    : a mislabelled exposure shifts what it decides by its error at most; the check sees it.

Setup    : 1/64, 1/8 and 1 s, linear 16-bit; one label in turn is 0.3 EV (a factor of 1.23) long.
Expected : every pixel stays within 0.3 EV of the truth plus noise, as L is a weighted mean of the
           exposures' own radiances. With the shortest mislabelled the brightest lights, a sun, are
           0.3 EV too dark. The merge itself cannot know; the check reports the pair.
Measured : −0.300 EV in the range that only the mislabelled exposure decides; the check reports
           0.30 ± 0.01 EV in the mislabelled pairs.
"""

import numpy as np
import pytest

from capture.exposure_check import exposure_disagreement_ev
from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import LINEAR_16_BIT, record

TIMES_S = np.array([1 / 64, 1 / 8, 1.0])
ERROR_EV = 0.3


@pytest.mark.parametrize("wrong", [0, 1, 2], ids=["shortest", "middle", "longest"])
def test_error_stays_within_the_mislabelling(wrong):
    rng = np.random.default_rng(1)
    truth = np.exp(rng.uniform(np.log(0.05), np.log(60), (200, 200, 3)))
    bracket = record(truth, [Exposure(t) for t in TIMES_S], LINEAR_16_BIT, rng)
    labels_s = TIMES_S.copy()
    labels_s[wrong] *= 2**ERROR_EV
    mislabelled = Bracket(
        tuple(
            Frame(frame.counts, Exposure(label_s), index=frame.index)
            for frame, label_s in zip(bracket.frames, labels_s, strict=True)
        )
    )
    image = merge_bracket(mislabelled, LINEAR_16_BIT)
    error_ev = np.log2(image.radiance / truth)
    noise_ev = 6 * np.sqrt(image.variance) / image.radiance / np.log(2)
    assert (error_ev > -ERROR_EV - noise_ev).all()
    assert (error_ev < noise_ev).all()
    # Pixels that only this exposure and shorter ones see: it holds 8/9 of their light or more.
    decided = (truth < 0.95 / TIMES_S[wrong]) & (truth > 1.05 / np.append(TIMES_S, 20)[wrong + 1])
    assert np.median(error_ev[decided]) == pytest.approx(-ERROR_EV, abs=0.04)

    expected = np.zeros(3)
    expected[wrong] = ERROR_EV
    np.testing.assert_allclose(
        exposure_disagreement_ev(mislabelled, LINEAR_16_BIT), -np.diff(expected), atol=0.03
    )
