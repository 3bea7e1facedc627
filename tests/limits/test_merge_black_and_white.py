"""Claim    : brackets without any information are marked or bounded, never invented.

Setup    : every count 0; every count 255; every count at black (1024) of a linear sensor; each
           in three exposures of 1/64, 1/8 and 1 s.
Expected : black: radiance below one count of the longest exposure, a variance to match, not
           clipped. White: 1 / shortest signal, all clipped. Everything finite and valid.
Measured : as expected; σ in the black is 1.4e-4 of the longest exposure's range, the read noise.
"""

import numpy as np

from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT

EXPOSURES = [Exposure(time_s) for time_s in (1 / 64, 1 / 8, 1.0)]


def merged(counts, dtype, sensor):
    picture = np.full((5, 6, 3), counts, dtype)
    return merge_bracket(Bracket(tuple(Frame(picture, each) for each in EXPOSURES)), sensor)


def test_all_black():
    for image in (merged(0, np.uint8, SRGB_8_BIT), merged(1024, np.uint16, LINEAR_16_BIT)):
        assert (image.radiance == 0).all()
        assert not image.clipped.any()
        assert image.valid.all()
        sigma = np.sqrt(image.variance)
        np.testing.assert_allclose(sigma, 4 / 30_000, rtol=0.3)


def test_all_white():
    for image in (merged(255, np.uint8, SRGB_8_BIT), merged(65535, np.uint16, LINEAR_16_BIT)):
        np.testing.assert_allclose(image.radiance, 64, rtol=1e-6)
        assert image.clipped.all()
        assert image.valid.all()
        assert np.isfinite(image.variance).all()
