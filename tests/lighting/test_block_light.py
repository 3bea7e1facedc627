"""The light and the colours of blocks against the sums over all they hold."""

import numpy as np
import pytest

from lighting.blocks.block_light import block_colours, block_light
from lighting.blocks.summed_area import block_sums
from tests.environments import outdoors


# Blocks of one cell, of two and of three a side, the last row and column of one and two.
@pytest.mark.parametrize("height", [32, 301, 514])
def test_blocks_are_those_of_the_sums(height):
    radiance = outdoors(height).radiance
    sums = block_sums(radiance)
    light, integral = block_light(radiance)
    np.testing.assert_allclose(light, sums[..., 0], rtol=1e-12)
    np.testing.assert_allclose(integral, sums[..., 4:].sum(axis=(0, 1)), rtol=1e-12)
    last = light.size - 1
    blocks = np.append(np.random.default_rng(0).integers(0, last, 50), [0, last])
    expected = sums.reshape(-1, 7)[blocks, 4:]
    np.testing.assert_allclose(block_colours(radiance, blocks), expected, rtol=1e-12)


def test_channels_of_the_brightest_cells_do_not_overflow():
    light, integral = block_light(np.full((2, 4, 3), 3e38, np.float32))
    assert np.isfinite(light).all()
    np.testing.assert_allclose(integral, 4 * np.pi * 3e38, rtol=1e-6)
