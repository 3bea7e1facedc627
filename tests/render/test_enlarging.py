"""Pictures drawn smaller keep their light and their place."""

import numpy as np
import pytest

from render.output.enlarging import enlarged


def test_a_ramp_stays_a_ramp_in_its_place():
    column, row = np.meshgrid((np.arange(12) + 0.5) / 12, (np.arange(8) + 0.5) / 8)
    small = np.stack([column, row, column + row, np.ones_like(row)], axis=-1).astype(np.float32)
    large = enlarged(small, (30, 20))
    column, row = np.meshgrid((np.arange(30) + 0.5) / 30, (np.arange(20) + 0.5) / 20)
    ramp = np.stack([column, row, column + row, np.ones_like(row)], axis=-1)
    np.testing.assert_allclose(large[2:-2, 2:-2], ramp[2:-2, 2:-2], atol=1e-6)


@pytest.mark.parametrize("size_px", [(13, 9), (48, 32)])
def test_nothing_is_brighter_than_before(size_px):
    rng = np.random.default_rng(5)
    small = rng.lognormal(sigma=4, size=(8, 12, 4)).astype(np.float32)
    large = enlarged(small, size_px)
    assert large.shape == (size_px[1], size_px[0], 4)
    assert large.min() >= small.min()
    assert large.max() <= small.max()


def test_a_whole_picture_stays_what_it_is():
    whole = np.ones((8, 12, 4), np.float32)
    assert enlarged(whole, (12, 8)) is whole
