"""Reduced frames: means and maxima of whole squares of pixels, never of none."""

import numpy as np
import pytest

from capture.frame import Exposure, Frame
from capture.reduced import reduced_brightest, reduced_linear, reduction
from tests.capture.simulated_bracket import SRGB_8_BIT


@pytest.mark.parametrize(
    ("size_px", "step"),
    [((1448, 1448), 1), ((1449, 1448), 2), ((6000, 4000), 4), ((1, 3_000_000), 1)],
    # 1448² < 2²¹ < 1449 · 1448; √(24 · 10⁶ / 2²¹) = 3.4; half of one row is no picture.
)
def test_so_many_pixels_remain_or_one_row(size_px, step):
    assert reduction(size_px, 2**21) == step


def test_squares_are_averaged_in_linear_light_and_their_brightest_counts_kept():
    counts = np.random.default_rng(1).integers(0, 256, (11, 16, 3), np.uint8)
    squares = counts[:9, :15].reshape(3, 3, 5, 3, 3)
    np.testing.assert_array_equal(reduced_brightest(counts, 3), squares.max(axis=(1, 3)))
    linear = SRGB_8_BIT.linear_table()[squares, np.arange(3)].mean(axis=(1, 3))
    found = reduced_linear(Frame(counts, Exposure(1.0)), SRGB_8_BIT, 3)
    np.testing.assert_allclose(found, linear, rtol=1e-5)
