"""Registration of two pictures against motions that the test makes itself."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from capture.registration import register, rigid_motion, warped, warped_mask

WIDTH, HEIGHT = 240, 170
ALL = np.ones((HEIGHT, WIDTH), bool)


def texture(seed=0, grain_px=3.0):
    noise = np.random.default_rng(seed).normal(0, 1, (HEIGHT + 80, WIDTH + 80)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), grain_px)
    return smooth / smooth.std()


def cut(picture, motion):
    """What a camera sees of a larger picture after its own picture has moved by `motion`."""
    y_px, x_px = np.mgrid[:HEIGHT, :WIDTH]
    seen = np.linalg.inv(motion) @ np.stack([x_px.ravel(), y_px.ravel(), np.ones(x_px.size)])
    # OpenCV's cubic warps round positions to a thirtieth of a pixel; this one does not.
    values = map_coordinates(picture, [seen[1] + 40, seen[0] + 40], order=3)
    return values.reshape(HEIGHT, WIDTH)


def corner_error_px(one, other):
    corners = np.array([[0, WIDTH - 1, 0, WIDTH - 1], [0, 0, HEIGHT - 1, HEIGHT - 1], [1] * 4])
    return np.hypot(*((one - other) @ corners)[:2]).max()


def noisy(picture, seed, sigma=0.1):
    return picture + np.random.default_rng(seed).normal(0, sigma, picture.shape).astype(np.float32)


def test_a_motion_turns_about_the_middle_from_x_to_y_and_then_shifts():
    # A quarter turn takes the point right of the middle to below it: +x becomes +y.
    motion = rigid_motion((2.0, -1.0), math.pi / 2, (101, 51))
    np.testing.assert_allclose(motion @ [60, 25, 1], [50 + 2, 35 - 1, 1], atol=1e-12)


@settings(max_examples=12, deadline=None)
@given(
    x_px=st.floats(-20, 20), y_px=st.floats(-20, 20), rotation_rad=st.floats(-0.1, 0.1),
    seed=st.integers(0, 1000),
)  # fmt: skip
def test_motions_are_found_to_a_fiftieth_of_a_pixel(x_px, y_px, rotation_rad, seed):
    scene = texture(seed)
    motion = rigid_motion((x_px, y_px), rotation_rad, (WIDTH, HEIGHT))
    reference = noisy(cut(scene, np.eye(3)), seed + 1, 0.02)
    found = register(reference, noisy(cut(scene, motion), seed + 2, 0.02), ALL)
    assert corner_error_px(found.motion, motion) < 0.02
    assert found.deviation_px < 0.02
    assert found.correlation > 0.95


def test_the_deviation_is_that_of_repeats():
    # Noise as large as the texture, so that errors are seen; still pictures, so that interpolation
    # adds none. 20 repeats tell a standard deviation to 16 %.
    scene = cut(texture(5), np.eye(3))
    found = [
        register(noisy(scene, 2 * k, 1.0), noisy(scene, 2 * k + 1, 1.0), ALL) for k in range(20)
    ]
    errors_px = [corner_error_px(each.motion, np.eye(3)) for each in found]
    predicted_px = np.mean([each.deviation_px for each in found])
    assert 0.5 < np.sqrt(np.mean(np.square(errors_px))) / predicted_px < 1.5


def test_brightness_makes_no_difference():
    scene = texture(1)
    motion = rigid_motion((3.4, -2.7), 0.02, (WIDTH, HEIGHT))
    plain = register(cut(scene, np.eye(3)), cut(scene, motion), ALL).motion
    other = register(cut(scene, np.eye(3)), 0.5 * cut(scene, motion) - 3, ALL).motion
    assert corner_error_px(plain, other) < 0.01


def test_what_moves_by_itself_is_left_out():
    scene = texture(2)
    motion = rigid_motion((3.4, -2.7), 0.01, (WIDTH, HEIGHT))
    picture = cut(scene, motion)
    other = rigid_motion((1.4, -0.7), 0.01, (WIDTH, HEIGHT))
    picture[40:130, 60:170] = cut(scene, other)[40:130, 60:170]  # a quarter of it
    found = register(cut(scene, np.eye(3)), picture, ALL)
    assert corner_error_px(found.motion, motion) < 0.03


def test_what_stands_still_is_not_looked_at():
    scene = texture(4)
    motion = rigid_motion((4.0, 2.5), 0.0, (WIDTH, HEIGHT))
    y_px, x_px = np.mgrid[:HEIGHT, :WIDTH]
    circle = np.hypot(x_px - 120, y_px - 85) < 75
    one, other = (
        np.where(circle, cut(scene, m), -20.0).astype(np.float32) for m in (np.eye(3), motion)
    )
    assert corner_error_px(register(one, other, circle).motion, motion) < 0.05
    assert corner_error_px(register(one, other, ALL).motion, motion) > 1  # it would be the rim


@pytest.mark.parametrize("nothing", ["flat", "noise", "stripes"])
def test_pictures_that_do_not_tell_say_so(nothing):
    one, other = np.zeros((2, HEIGHT, WIDTH), np.float32)
    if nothing == "stripes":  # they tell nothing of shifts along them
        one[:] = other[:] = np.sin(np.arange(WIDTH) / 5)
    if nothing == "noise":
        one, other = noisy(one, 1), noisy(other, 2)
    found = register(one, other, ALL)
    assert found.deviation_px > 0.5 or found.correlation < 0.5


def test_a_mask_holds_where_every_pixel_read_is_in_it():
    motion = rigid_motion((2.5, 0.0), 0.0, (WIDTH, HEIGHT))
    mask = ALL.copy()
    mask[:, :10] = False
    expected = np.ones_like(mask)
    expected[:, :8] = False  # column 7 reads 9.5
    expected[:, -3:] = False  # column 237 reads 239.5, half of it beyond the edge
    np.testing.assert_array_equal(warped_mask(mask, motion), expected)
    ramp = np.tile(np.arange(WIDTH, dtype=np.float32), (HEIGHT, 1))
    np.testing.assert_allclose(warped(ramp, motion)[:, :-3], ramp[:, :-3] + 2.5)
