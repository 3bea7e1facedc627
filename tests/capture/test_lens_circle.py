"""The circle of a lens, found in pictures that hold it or a part of it."""

import numpy as np
import pytest

from capture.lens_circle import outside_circle

WIDTH, HEIGHT = 160, 100


def disc(x_px, y_px, radius_px):
    rows, columns = np.ogrid[:HEIGHT, :WIDTH]
    return np.hypot(columns - x_px, rows - y_px) <= radius_px


@pytest.mark.parametrize("radius_px", [40, 70], ids=["whole", "cut by the picture's edge"])
def test_what_lies_outside_is_known_to_a_pixel(radius_px):
    inside = disc(82.0, 47.0, radius_px)
    picture = np.repeat(np.where(inside, np.float32(0.2), 0)[..., None], 3, axis=2)
    outside = outside_circle([np.zeros_like(picture), picture])
    assert not outside[disc(82.0, 47.0, radius_px - 1)].any()
    assert outside[~disc(82.0, 47.0, radius_px + 1)].all()


def test_a_bright_corner_or_another_shape_is_no_circle():
    picture = np.full((HEIGHT, WIDTH, 3), 0.2, np.float32)
    assert outside_circle([picture]) is None
    picture[:20] = picture[-20:] = picture[:, :50] = picture[:, -50:] = 0
    assert outside_circle([picture]) is None
