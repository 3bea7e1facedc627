"""The camera that took a plate: its lens, its tilt, and how high above the ground it stood.

Domain : a pinhole whose axis meets the middle of the picture. The ground is level, at y = 0, and
the camera stands above the origin. A heading of 0 looks along +Z, the middle of a lat-long map.
Input  : what is known of the camera.    Output : a Camera, and where pixels see the ground.
Fails  : a picture that was cropped to one side has its axis elsewhere.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.camera import yaw_rotation
from capture.errors import InputError
from render.scenes.scene import Camera

Array = NDArray[np.float64]

_STEEPEST_RAD = math.radians(89)


def plate_camera(
    size_px: tuple[int, int], focal_px: float, zenith: Array, yaw_rad: float, height_m: float
) -> Camera:
    """Return the camera.

    Parameters
    ----------
    size_px : (int, int)
        (width, height).
    focal_px : float
    zenith : (3,) float64
        Direction of the zenith in the camera's frame (+x right, +y down, +z forward).
    yaw_rad : float
        Heading, as `yaw_rotation` turns it: toward +X, to the left.
    height_m : float
        Of the camera above the ground.

    Raises
    ------
    InputError
        If the height is not positive, or the camera looks straight up or down.
    """
    if not 0 < height_m < math.inf:
        raise InputError(f"a plate's camera stands above the ground, got {height_m} m")
    zenith = zenith / np.linalg.norm(zenith)
    if abs(zenith[2]) > math.sin(_STEEPEST_RAD):
        raise InputError("the plate's camera looks straight up or down, and so has no heading")
    ahead = np.array([0.0, 0.0, 1.0]) - zenith[2] * zenith
    ahead /= np.linalg.norm(ahead)
    R_world_camera = yaw_rotation(yaw_rad) @ np.stack([np.cross(zenith, ahead), zenith, ahead])
    eye = np.array([0.0, height_m, 0.0])
    fov_rad = 2 * math.atan(0.5 * size_px[1] / focal_px)
    return Camera(eye, eye + R_world_camera[:, 2], fov_rad, size_px, -R_world_camera[:, 1])


def zenith_of_pitch(pitch_rad: float) -> Array:
    """Return the zenith (3,) in the frame of a camera that looks up by an angle, without roll."""
    return np.array([0.0, -math.cos(pitch_rad), math.sin(pitch_rad)])


def focal_of_view(width_px: int, horizontal_fov_rad: float) -> float:
    """Return the focal length in pixels of a picture that sees so much from side to side."""
    if not 0 < horizontal_fov_rad < math.pi:
        raise InputError(
            "a plate's field of view is above 0° and below 180°, "
            f"got {math.degrees(horizontal_fov_rad):g}°"
        )
    return 0.5 * width_px / math.tan(0.5 * horizontal_fov_rad)


def directions_of(pixels: Array, size_px: tuple[int, int], focal_px: float) -> Array:
    """Return unit directions (N, 3) in the camera's frame of pixels (N, 2)."""
    middle = (np.array(size_px) - 1) / 2
    rays = np.column_stack([(pixels - middle) / focal_px, np.ones(len(pixels))])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def ground_point(camera: Camera, pixel: Sequence[float]) -> Array:
    """Return the point of the ground (3,), y = 0, that a pixel (x, y) sees.

    Raises
    ------
    InputError
        If it lies outside the picture, or sees no ground.
    """
    width, height = camera.size_px
    x, y = pixel
    if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
        raise InputError(f"the pixel {x:g},{y:g} lies outside a plate of {width}×{height}")
    across, up = camera.half_extent()
    ray = [
        across * ((2 * x + 1) / width - 1),
        up * (1 - (2 * y + 1) / height),
        -1.0,
    ] @ camera.axes()
    if ray[1] >= 0:
        raise InputError(
            f"the pixel {x:g},{y:g} lies above the horizon, and objects stand on the ground: "
            "correct the pixel, or how the camera is tilted"
        )
    return np.array(camera.eye - camera.eye[1] / ray[1] * ray) * [1.0, 0.0, 1.0]


def pixels_of(camera: Camera, points: Array) -> Array:
    """Return pixels (M, 2) of those world points (N, 3) that lie before the camera."""
    right, up, back = camera.axes() @ (points - camera.eye).T
    is_before = back < 0
    right, up, ahead = right[is_before], up[is_before], -back[is_before]
    across, high = camera.half_extent()
    width, height = camera.size_px
    x = (width * (1 + right / (across * ahead)) - 1) / 2
    y = (height * (1 - up / (high * ahead)) - 1) / 2
    return np.column_stack([x, y])
