"""Claim    : what moves between the exposures is mixed, within the range of what they saw.

Setup    : 1/256, 1/16 and 1 s; a light of radiance 100 over a background of 0.2 stands at one
           place in the shortest exposure and at another in the two longer ones.
Expected : L is a weighted mean of the exposures' own radiances, so it lies between the least and
           the greatest. At the old place the shortest exposure contradicts the longer ones, which
           are left out, and the light stays where it was first; at the new place they are full
           and left out, and the shortest saw background. So the light is there once, late by the
           length of the bracket. A dimmer one, which no exposure clips, is smeared over both.
Measured : old place 100.0, new place 0.2.
"""

import numpy as np

from capture.frame import Bracket, Exposure
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import LINEAR_16_BIT, record

BACKGROUND, LIGHT = 0.2, 100.0


def test_a_light_that_moves_stays_where_the_shortest_exposure_saw_it():
    rng = np.random.default_rng(1)
    before, after = np.full((2, 40, 40, 3), BACKGROUND)
    old_place, new_place = np.s_[5:15, 5:15], np.s_[25:35, 25:35]
    before[old_place] = LIGHT
    after[new_place] = LIGHT
    shortest = record(before, [Exposure(1 / 256)], LINEAR_16_BIT, rng)
    longer = record(after, [Exposure(1 / 16), Exposure(1.0)], LINEAR_16_BIT, rng)
    bracket = Bracket(shortest.frames + longer.frames)
    image = merge_bracket(bracket, LINEAR_16_BIT)

    table = LINEAR_16_BIT.linear_table()
    seen = [table[frame.counts, 0] / frame.exposure.signal for frame in bracket.frames]
    assert (image.radiance >= np.min(seen, axis=0) * (1 - 1e-5)).all()
    assert (image.radiance <= np.max(seen, axis=0) * (1 + 1e-5)).all()
    np.testing.assert_allclose(image.radiance[new_place].mean(), BACKGROUND, rtol=0.1)
    np.testing.assert_allclose(image.radiance[old_place].mean(), LIGHT, rtol=0.01)
    assert not image.clipped.any()
