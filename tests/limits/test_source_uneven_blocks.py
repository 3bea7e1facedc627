"""The light of single blocks of a picture, under an even sky.

Claim    : a pixel's whole light is counted in the block of its middle, so that the light of a block
           over its solid angle is no radiance; that of many blocks is.
Setup    : an even sky in a 180° fisheye of 256² and of 1024² px, on 512×256 blocks; at least 20°
           inside the edge and 10° off the pole, where blocks are narrower than pixels. Single
           blocks beside groups of 16 × 16.
Expected : where pixels are as wide as blocks, 0.70°, many have none and others several, as if
           thrown: a deviation near 1. With sixteen pixels a block only those on its outline count.
           Groups are even to the pixels on theirs.
Measured : relative standard deviation 0.96 and 0.11 of single blocks, 0.011 and 0.0023 of groups.
"""

import numpy as np
import pytest

from calibration.camera import UP, Calibration
from calibration.models.equidistant import Equidistant
from capture.radiance import RadianceImage
from lighting.blocks.source_blocks import picture_blocks
from lighting.sphere.latlong import solid_angles

TOP, BOTTOM = 16, 96  # rows of 0.70° from the zenith


@pytest.mark.parametrize(("size", "single", "grouped"), [(256, 1.2, 0.02), (1024, 0.15, 0.005)])
def test_single_blocks_are_uneven_and_groups_are_not(size, single, grouped):
    lens = Equidistant(((size - 1) / 2,) * 2, size / np.pi)
    camera = Calibration(lens, (size, size), np.pi / 2, UP)
    even = np.ones((size, size, 3), np.float32)
    seen = np.ones((size, size), bool)
    sums = picture_blocks(camera, RadianceImage(even, 0 * even, seen, ~seen)).sums
    sky_sr = np.repeat(solid_angles(256)[TOP:BOTTOM, None], 512, axis=1)
    light = sums[TOP:BOTTOM, :, 4]
    assert single / 2 < np.std(light / sky_sr) < single
    groups, groups_sr = (each.reshape(5, 16, 32, 16).sum(axis=(1, 3)) for each in (light, sky_sr))
    assert np.std(groups / groups_sr) < grouped
    assert light.sum() == pytest.approx(sky_sr.sum(), rel=0.005)
