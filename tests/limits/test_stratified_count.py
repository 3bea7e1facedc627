"""One stratified random light more moves every other.

Claim    : the strata of n + 1 lights are not those of n, nor are their random numbers: a count that
           follows the frame rate reshuffles the whole set, and all shadows jump.
Setup    : the outdoor map of 64 rows, 48 to 80 lights one by one; each light of a set compared with
           the nearest of the set before.
Expected : degrees per step in the mean, and the change of irradiance from step to step, within
           twice what was measured.
Measured : 8.3° in the mean, 6.0 % of the irradiance in the mean and 10.5 % at most.
"""

import numpy as np

from lighting.reduce import reduce_to_lights
from tests.environments import irradiance, normals, outdoors


def test_all_lights_move_with_the_count():
    turns, received = [], []
    before = None
    for count in range(48, 81):
        lights = reduce_to_lights(outdoors(64), count, "stratified-random")
        received.append(irradiance(normals(), lights.directions, lights.irradiance))
        if before is not None:
            nearest = (lights.directions @ before.T).max(axis=1)
            turns.append(np.degrees(np.arccos(np.clip(nearest, -1, 1))).mean())
        before = lights.directions
    e = np.array(received)
    steps = np.sqrt(np.mean((e[1:] - e[:-1]) ** 2, axis=(1, 2)) / np.mean(e**2))
    assert np.mean(turns) < 16
    assert steps.mean() < 0.12
    assert steps.max() < 0.2
    # The weakness itself: the fixed points of the inverse CDF do not move at all.
    assert np.mean(turns) > 2
