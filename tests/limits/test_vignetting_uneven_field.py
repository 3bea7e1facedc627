"""A flat field that is not even is taken for vignetting.

Claim    : What darkens toward the rim in all pictures is the lens's; no flat field tells otherwise.
Setup    : A lens without vignetting before a field that loses 5 % from the axis to 90°, as paper
           under one lamp does, in two pictures between which the camera is turned about its axis;
           and before one that falls by 10 % from left to right.
Expected : The first becomes vignetting of 5 % at 90°. The second is told from the lens's, because
           the camera was turned: no more than 0.5 % remain.
Measured : 5.0 %, and nothing.
"""

from dataclasses import replace

import numpy as np
import pytest

from calibration.vignetting import fit_vignetting
from calibration.vignetting_samples import flat_samples
from tests.calibration.lit_pictures import LENS, pixel_directions, shot, turned

PERFECT = replace(LENS, vignetting=())
TURNS = (0.0, np.pi)


def test_a_field_that_darkens_outward_is_taken_for_the_lens() -> None:
    cameras = [turned(PERFECT, 0.0, roll) for roll in TURNS]
    angle = PERFECT.axis_angle(pixel_directions(PERFECT)[0])
    fields = [shot(each, 1 - 0.05 * (angle / (np.pi / 2)) ** 2) for each in cameras]
    chosen = fit_vignetting(flat_samples(fields)).chosen
    rim = chosen.illumination(np.array([np.pi / 2]), np.array([0.0]))[0]
    assert rim == pytest.approx(0.95, abs=0.003)


def test_a_slope_is_told_from_the_lens_by_turning_the_camera() -> None:
    cameras = [turned(PERFECT, 0.0, roll) for roll in TURNS]
    fields = [
        shot(each, 1 + 0.05 * pixel_directions(each)[0][..., 0], seed=i)
        for i, each in enumerate(cameras)
    ]
    chosen = fit_vignetting(flat_samples(fields)).chosen
    rim = chosen.illumination(np.full(8, 1.5), np.arange(8) * np.pi / 4)
    np.testing.assert_allclose(rim, 1.0, atol=0.005)
