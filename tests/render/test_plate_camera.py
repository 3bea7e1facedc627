"""The camera of a plate: where its pixels see the ground, and how it is tilted."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from calibration.pose.up import zenith_of_edges, zenith_of_horizon
from capture.errors import InputError
from render.plates.plate_camera import (
    directions_of,
    focal_of_view,
    ground_point,
    pixels_of,
    plate_camera,
    zenith_of_pitch,
)

SIZE_PX = (640, 480)
FOCAL_PX = 500.0


def camera_of(pitch_deg=-20.0, yaw_deg=0.0, height_m=1.5):
    zenith = zenith_of_pitch(math.radians(pitch_deg))
    return plate_camera(SIZE_PX, FOCAL_PX, zenith, math.radians(yaw_deg), height_m)


def test_the_middle_of_a_tilted_picture_sees_the_ground_at_a_known_distance():
    # 1.5 m up and 20° down: 1.5 / tan 20° ahead, which is +Z.
    point = ground_point(camera_of(), (319.5, 239.5))
    assert_allclose(point, [0, 0, 1.5 / math.tan(math.radians(20))], atol=1e-9)


def test_a_heading_turns_to_the_left_and_the_right_side_stays_right():
    point = ground_point(camera_of(yaw_deg=90), (319.5, 239.5))
    assert point[0] > 1
    assert abs(point[2]) < 1e-9
    assert ground_point(camera_of(), (500, 239.5))[0] < 0  # looking along +Z, +X is on the left


def test_the_field_of_view_is_that_of_the_focal_length():
    camera = camera_of()
    across, up = camera.half_extent()
    assert_allclose([across, up], [320 / FOCAL_PX, 240 / FOCAL_PX])
    assert focal_of_view(640, 2 * math.atan(320 / FOCAL_PX)) == pytest.approx(FOCAL_PX)


@settings(max_examples=30, deadline=None)
@given(
    pitch_deg=st.floats(-80, -30),
    yaw_deg=st.floats(-180, 180),
    x=st.floats(-0.5, 639.5),
    y=st.floats(-0.5, 479.5),
)
def test_pixels_of_ground_points_are_where_these_were_seen(pitch_deg, yaw_deg, x, y):
    camera = camera_of(pitch_deg, yaw_deg)
    assert_allclose(pixels_of(camera, ground_point(camera, (x, y))[None]), [[x, y]], atol=1e-6)


def test_points_behind_the_camera_have_no_pixel():
    assert len(pixels_of(camera_of(), np.array([[0.0, 0.0, -9.0], [0.0, 0.0, 9.0]]))) == 1


def test_edges_and_horizon_of_a_picture_tell_its_tilt():
    """A camera with roll: what it sees of posts and of the far ground gives its zenith back."""
    pitch, roll = math.radians(-15), math.radians(4)
    zenith = zenith_of_pitch(pitch)
    turn = np.array([[math.cos(roll), -math.sin(roll)], [math.sin(roll), math.cos(roll)]])
    zenith[:2] = turn @ zenith[:2]
    camera = plate_camera(SIZE_PX, FOCAL_PX, zenith, 0.7, 1.5)
    posts = [ground_point(camera, pixel) for pixel in ((100, 400), (550, 420))]
    edges = [pixels_of(camera, post + np.outer([0, 0.6], [0, 1, 0])) for post in posts]
    seen = [directions_of(edge, SIZE_PX, FOCAL_PX) for edge in edges]
    assert_allclose(zenith_of_edges(seen, 0.002).direction, zenith, atol=1e-9)
    ahead = camera.target - camera.eye
    far = 1e9 * np.array([[ahead[0] + side, 0, ahead[2] - side] for side in (-0.3, 0.3)])
    horizon = directions_of(pixels_of(camera, far), SIZE_PX, FOCAL_PX)
    found = zenith_of_horizon(horizon, np.array([0.0, -1.0, 0.0]), 0.002)
    assert_allclose(found.direction, zenith, atol=1e-6)


def test_what_sees_no_ground_is_refused():
    with pytest.raises(InputError, match="above the horizon"):
        ground_point(camera_of(-5), (320, 10))
    with pytest.raises(InputError, match="outside"):
        ground_point(camera_of(), (700, 10))
    with pytest.raises(InputError, match="straight"):
        camera_of(-90)
    with pytest.raises(InputError, match="above the ground"):
        camera_of(height_m=0)
    with pytest.raises(InputError, match="field of view"):
        focal_of_view(640, math.pi)
