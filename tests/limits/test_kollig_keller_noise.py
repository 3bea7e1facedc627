"""Noise sends relaxed lights elsewhere, and to other numbers.

Claim    : growth and relaxation end in one of many local minima, and noise decides in which; even a
           light that stays may have another number.
Setup    : the outdoor map of 64 rows, with and without independent noise of 2 % in each cell, 64
           lights; six times.
Expected : degrees to the light of the same number, and from each light with noise to the nearest
           without, in the mean, within 1.5 times what was measured.
Measured : Kollig and Keller 55° and 7.8°, Lloyd 80° and 8.0°; the Q2-tree 11° and 0.02°.
"""

import numpy as np
import pytest

from lighting.reduce import reduce_to_lights
from tests.environments import environment, outdoors


def turns(method):
    """Return mean degrees to the light of the same number, and to the nearest light."""
    plain = outdoors(64)
    before = reduce_to_lights(plain, 64, method).directions
    same, nearest = [], []
    for seed in range(6):
        noise = np.random.default_rng(seed).standard_normal((64, 128, 1))
        noisy = environment(plain.radiance * (1 + 0.02 * noise))
        cosine = np.clip(before @ reduce_to_lights(noisy, 64, method).directions.T, -1, 1)
        same.append(np.degrees(np.arccos(np.diag(cosine))).mean())
        nearest.append(np.degrees(np.arccos(cosine.max(axis=0))).mean())
    return np.mean(same), np.mean(nearest)


@pytest.mark.parametrize(
    ("method", "same_deg", "nearest_deg"), [("kollig-keller", 82, 11.7), ("lloyd", 120, 12)]
)
def test_lights_stay_within_bounds(method, same_deg, nearest_deg):
    same, nearest = turns(method)
    assert same < same_deg
    assert nearest < nearest_deg


def test_lights_do_go_elsewhere():
    # The weakness itself: in fixed cells noise hardly moves a light.
    assert turns("kollig-keller")[1] > 3
    assert turns("q2-tree")[1] < 0.1
