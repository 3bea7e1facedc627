"""Claim    : a pixel that is full in every exposure gives a lower bound and is marked.

Setup    : linear 16-bit and sRGB 8-bit, 1/1000 s and up to four more in 2 EV steps, radiance up to
           ten times what the shortest exposure can hold, 1000.
Expected : exactly 1000 and `clipped`, whatever the truth; never grey, never black.
Measured : 1000 at a truth of 1000 to 10000, where OpenCV's MergeDebevec gives 62.5 and its
           MergeRobertson 0. The power of such a sun is lost by the factor truth / 1000: a mark is
           all that the merge can offer.
"""

import cv2
import numpy as np
import pytest

from capture.frame import Exposure
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT, record

TIMES_S = [1e-3 * 4.0**k for k in range(5)]
BOUND = 1 / TIMES_S[0]


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"])
def test_the_sun_is_at_its_lower_bound_and_marked(sensor):
    truth = np.full((4, 40, 3), 0.2)
    truth[:, 20:] = np.geomspace(1.05 * BOUND, 10 * BOUND, 20)[:, None]
    exposures = [Exposure(time_s) for time_s in TIMES_S[:3]]
    image = merge_bracket(record(truth, exposures, sensor, np.random.default_rng(1)), sensor)
    np.testing.assert_allclose(image.radiance[:, 20:], BOUND, rtol=1e-6)
    np.testing.assert_array_equal(image.clipped, (truth > BOUND).any(axis=-1))
    assert image.valid.all()


def test_the_peers_lose_it():
    # Why it matters; fails when OpenCV learns better, and the claim above needs new words.
    truth = np.full((4, 40, 3), 10 * BOUND)
    exposures = [Exposure(time_s) for time_s in TIMES_S]
    bracket = record(truth, exposures, SRGB_8_BIT, np.random.default_rng(1))
    pictures = [frame.counts for frame in bracket.frames]
    times_s = np.array(TIMES_S, np.float32)
    response = np.maximum(SRGB_8_BIT.response[:, None, :], 1e-6).astype(np.float32)
    debevec = cv2.createMergeDebevec().process(pictures, times_s, response)
    robertson = cv2.createMergeRobertson().process(pictures, times_s, response)
    assert debevec.max() < BOUND / 10
    assert robertson.max() == 0
