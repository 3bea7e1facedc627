"""Claim    : a pixel that is stuck at white keeps the shortest exposure at the camera's shortest.

Setup    : an even grey scene of 100×100 pixels that one exposure of 33 ms measures; one pixel of it
           is white in every exposure. Values may be clipped up to a share of 2e-6.
Expected : one pixel in ten thousand is more than that, so the light there is taken for a source
           that no exposure holds. The rest then needs a second exposure, which is balanced against
           the first: √(0.98 / 20 · 0.1 ms) = 2.2 ms, with 15 times less light than the 33 ms.
Measured : one exposure of 33.3 ms without the pixel; 0.1 and 2.2 ms with it.
"""

import numpy as np
import pytest

from capture.exposure_plan import first_plan, next_plan, possible_times, usable_light
from capture.frame import Exposure
from capture.scene_range import scene_range
from tests.capture.simulated_bracket import SRGB_8_BIT, record

POSSIBLE_S = possible_times((1e-4, 0.0333), 1e-4)


def chosen_s(radiance):
    light = usable_light(SRGB_8_BIT)
    plan = first_plan(light, POSSIBLE_S)
    for seed in range(3):
        exposures = [Exposure(time_s) for time_s in plan.times_s]
        bracket = record(radiance, exposures, SRGB_8_BIT, np.random.default_rng(seed))
        plan = next_plan(plan, scene_range(bracket, SRGB_8_BIT), light, POSSIBLE_S)
    return plan.times_s


def test_a_stuck_pixel_costs_an_exposure():
    radiance = np.full((100, 100, 3), 20.0)
    sound_s = chosen_s(radiance)
    assert sound_s == pytest.approx((0.0333,))
    radiance[50, 50] = 1e6
    stuck_s = chosen_s(radiance)
    assert stuck_s == pytest.approx((1e-4, 0.0022), rel=0.03)
