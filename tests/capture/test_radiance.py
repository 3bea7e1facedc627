"""Radiance is made fit for use at the door, and what was removed is counted."""

import numpy as np
import pytest

from capture.radiance import RadianceImage, clean_radiance


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_no_radiance_is_removed_and_counted(dtype):
    picture = np.ones((1, 5, 3), dtype)
    picture[0, 0, 0] = np.nan
    picture[0, 1, :2] = np.inf, -np.inf
    picture[0, 2, 1] = -2.0
    picture[0, 3, 2] = -np.inf
    cleaned = clean_radiance(picture)
    np.testing.assert_array_equal(cleaned.valid, [[False, False, True, False, True]])
    np.testing.assert_array_equal(cleaned.radiance[0, [0, 1, 3]], 0)
    np.testing.assert_array_equal(cleaned.radiance[0, 2], [1, 0, 1])
    np.testing.assert_array_equal(cleaned.radiance[0, 4], 1)
    assert str(cleaned) == "1 NaN, 3 infinite, 1 negative"


def test_what_is_infinite_in_float32_counts_as_infinite():
    picture = np.ones((1, 2, 3))
    picture[0, 0, 1] = 1e39
    cleaned = clean_radiance(picture)
    np.testing.assert_array_equal(cleaned.valid, [[False, True]])
    np.testing.assert_array_equal(cleaned.radiance[0], [[0, 0, 0], [1, 1, 1]])
    assert str(cleaned) == "1 infinite"


@pytest.mark.parametrize("value", [np.nan, -np.nan, np.inf, -np.inf, -1.0, -1e-45])
def test_an_image_takes_only_clean_radiance(value):
    picture = np.ones((1, 2, 3), np.float32)
    picture[0, 1, 2] = value
    mask = np.ones((1, 2), bool)
    with pytest.raises(ValueError, match="clean_radiance"):
        RadianceImage(picture, np.zeros_like(picture), mask, ~mask)


@pytest.mark.parametrize("value", [-0.0, 0.0, 1e-45, np.finfo(np.float32).max])
def test_an_image_takes_any_number_from_0_up(value):
    picture = np.full((1, 2, 3), value, np.float32)
    mask = np.ones((1, 2), bool)
    np.testing.assert_array_equal(
        RadianceImage(picture, np.zeros_like(picture), mask, ~mask).radiance, picture
    )
