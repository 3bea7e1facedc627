"""Claim    : brackets without any information are marked or bounded, never invented.

Setup    : every count 0; every count 255; every count at black (1024) of a linear sensor; each
           in three exposures of 1/64, 1/8 and 1 s.
Expected : black: radiance 0, not clipped, and a variance that bounds what may have been there: the
           truth of pixels that every exposure saw black is below 4 σ for 99.5 % of them (photons'
           own noise, which black does not show, makes it more than 3 σ). White: 1 / shortest
           signal, all clipped. Everything finite and valid.
Measured : as expected; σ in the black is 1.4e-4 of the longest exposure's range, the read noise.
           Below 3 σ are 98.4 % (8 bits) and 98.9 % (16 bits) of the truths, below 4 σ 99.8 %.
"""

import numpy as np
import pytest

from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT, record

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


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"])
def test_the_variance_of_black_bounds_what_was_there(sensor):
    # Every truth as likely as any other.
    truth = np.random.default_rng(1).uniform(0, 2e-3, (400, 500, 1)) * np.ones(3)
    bracket = record(truth, EXPOSURES, sensor, np.random.default_rng(2))
    image = merge_bracket(bracket, sensor)
    black = np.all([frame.counts <= sensor.black_dn for frame in bracket.frames], axis=0)
    assert black.sum() > 2000
    assert (image.radiance[black] == 0).all()
    deviations = truth[black] / np.sqrt(image.variance[black])
    assert (deviations < 4).mean() > 0.995
    assert (deviations < 3).mean() < 0.995


def test_all_white():
    for image in (merged(255, np.uint8, SRGB_8_BIT), merged(65535, np.uint16, LINEAR_16_BIT)):
        np.testing.assert_allclose(image.radiance, 64, rtol=1e-6)
        assert image.clipped.all()
        assert image.valid.all()
        assert np.isfinite(image.variance).all()
