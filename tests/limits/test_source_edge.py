"""A sun on the edge of what the camera sees, straight from the picture.

Claim    : light on the edge comes and goes by whole pixels: a pixel counts in full if its centre is
           seen, and for nothing otherwise.
Setup    : a fisheye of 128² whose valid angle is set to 80°, and pictures with one lit pixel along
           a row across the edge, each at the radiance that has flux 1; an even sky.
Expected : flux 1 inside and 0 outside, with no pixel between. The even sky is off by the pixels on
           the edge, about √(m/12) of the m = 450 that it crosses: 0.06 % of the field.
Measured : so; the even sky is off by 0.009 %.
"""

import numpy as np
import pytest

from calibration.camera import UP, Calibration
from calibration.models.equidistant import Equidistant
from capture.radiance import RadianceImage
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks

CAMERA = Calibration(Equidistant((63.5, 63.5), 128 / np.pi), (128, 128), np.radians(80), UP)


def picture(radiance):
    linear = radiance.astype(np.float32)
    seen = np.ones(linear.shape[:2], bool)
    return RadianceImage(linear, 0 * linear, seen, ~seen)


def test_pixels_on_the_edge_count_in_full_or_not_at_all():
    source = build_source_blocks(CAMERA, 32)
    fluxes = []
    for column in range(112, 128):
        theta = np.hypot(column - 63.5, 0.5) * np.pi / 128
        radiance = np.zeros((128, 128, 3))
        radiance[63, column] = 1 / (np.sinc(theta / np.pi) * (np.pi / 128) ** 2)
        fluxes.append(apply_source_blocks(source, picture(radiance)).integral()[0])
    # The centre of column 120 is at 79.4°, and its pixel reaches to 80.2°.
    np.testing.assert_allclose(fluxes[:9], 1, atol=1e-3)
    np.testing.assert_array_equal(fluxes[9:], 0)


def test_the_error_of_an_even_sky_is_below_half_a_pixel_all_along_the_edge():
    blocks = apply_source_blocks(build_source_blocks(CAMERA, 32), picture(np.ones((128, 128, 3))))
    field_sr = 2 * np.pi * (1 - np.cos(np.radians(80)))
    assert blocks.integral()[0] == pytest.approx(field_sr, rel=1e-3)
    assert abs(blocks.integral()[0] / field_sr - 1) > 1e-6  # the weakness is there
