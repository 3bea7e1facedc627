"""Claim    : ghosts that are dim or out of range stay, within what the exposures saw.

Setup    : 1/16, 1/4 and 1 s, linear 16-bit, over grey. Between the first two exposures and the
           third a patch of 40 by 40 px appears: 0.2 EV brighter; or so dark that only the longest
           exposure measures it.
Expected : neither is found. The dim one is merged: radiance lies between its two states, near the
           later one, as the longest exposure counts for three quarters. The dark one is seen by one
           exposure, and what that saw outweighs the others' noise.
Measured : 0.155 EV above the background of 0.2 EV; in the dark 4.6e-4 of 5e-4.
"""

import numpy as np

from capture.frame import Bracket, Exposure
from capture.ghosts import find_ghosts
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import LINEAR_16_BIT, record

EXPOSURES = [Exposure(time_s) for time_s in (1 / 16, 1 / 4, 1.0)]
PATCH = np.s_[40:80, 40:80]


def appearing(background, patch, where):
    before = np.full((120, 160, 3), background)
    after = before.copy()
    after[where] = patch
    rng = np.random.default_rng(1)
    frames = [
        record(view, [exposure], LINEAR_16_BIT, rng).frames[0]
        for view, exposure in zip((before, before, after), EXPOSURES, strict=True)
    ]
    return Bracket(tuple(frames))


def test_a_dim_one_is_merged_between_its_states():
    bracket = appearing(0.2, 0.2 * 2**0.2, PATCH)
    assert not find_ghosts(bracket, LINEAR_16_BIT).any()
    above_ev = np.log2(merge_bracket(bracket, LINEAR_16_BIT).radiance[PATCH].mean() / 0.2)
    assert 0.1 < above_ev < 0.2
    # A little brighter it is found.
    assert find_ghosts(appearing(0.2, 0.2 * 2**0.4, PATCH), LINEAR_16_BIT)[PATCH].mean() > 0.9


def test_one_in_the_dark_shows_the_state_of_the_exposure_that_sees_it():
    bracket = appearing(1e-4, 5e-4, PATCH)
    assert not find_ghosts(bracket, LINEAR_16_BIT).any()
    seen = merge_bracket(bracket, LINEAR_16_BIT).radiance[PATCH].mean()
    assert 4e-4 < seen < 5e-4
