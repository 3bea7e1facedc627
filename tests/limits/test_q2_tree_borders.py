"""The Q2-tree's lights jump as a source passes from leaf to leaf.

Claim    : leaves are parted where a source comes and joined where it has been, so lights of some
           leaves are spent on others, anywhere.
Setup    : passing_lamp.py, along a border of the first quadrilaterals and beside it.
Expected : the share of the lights that are replaced or moved per frame, and the change of the
           irradiance's error, within 1.5 times what was measured.
Measured : 25 and 28 % of the lights, 34 % at most; the error changes by 0.08 and 0.14 % per frame.
           A light of the same number turns by up to 180°.
"""

from itertools import pairwise

import numpy as np
import pytest

from tests.limits.passing_lamp import passing_lamp, vanished


@pytest.mark.parametrize(("middle", "change"), [(0.0, 0.0013), (0.5, 0.0022)])
def test_lights_jump_within_bounds(middle, change):
    sets, change_of_error = passing_lamp("q2-tree", middle)
    shares = vanished(sets)
    assert shares.mean() < 0.41
    assert shares.max() < 0.52
    assert change_of_error < change


def test_lights_do_jump():
    # The weakness itself.
    sets, _ = passing_lamp("q2-tree", 0.5)
    cosines = [
        (before.directions * after.directions).sum(axis=1) for before, after in pairwise(sets)
    ]
    assert np.min(cosines) < np.cos(np.radians(90))
