"""Pictures of light that is known exactly, through a lens whose vignetting is known exactly."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import LEVEL, Calibration
from calibration.models.equidistant import Equidistant
from calibration.vignetting_samples import Shot
from capture.radiance import RadianceImage

Array = NDArray[np.float64]

SIZE = 240
VIGNETTING = (-0.22, 0.06, -0.018)
UNEVEN = (0.03, -0.02, 0.015, 0.0)
LENS = Calibration(
    Equidistant(((SIZE - 1) / 2, (SIZE - 1) / 2), SIZE / np.pi / 1.02),
    (SIZE, SIZE),
    np.radians(91),
    vignetting=VIGNETTING,
)
UNEVEN_LENS = replace(LENS, uneven_vignetting=UNEVEN)


def turned(calibration: Calibration, yaw_rad: float, roll_rad: float = 0.0) -> Calibration:
    """The camera rolled about its axis, then turned about the world's +Y."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    yaw = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    roll = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return replace(calibration, R_world_camera=yaw @ LEVEL @ roll)


def pixel_directions(calibration: Calibration) -> tuple[Array, NDArray[np.bool_]]:
    """World directions (H, W, 3) of the pixels, and which see anything."""
    x, y = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
    directions, seen = calibration.unproject(np.stack([x, y], axis=-1).astype(float))
    return np.nan_to_num(directions), seen


def shot(calibration: Calibration, light: Array, name: str = "picture", seed: int = 0) -> Shot:
    """What a picture of light (H, W) at the pixels shows: darkened, with 1 % of noise."""
    directions, seen = pixel_directions(calibration)
    noise = 1 + 0.01 * np.random.default_rng(seed).standard_normal(light.shape)
    value = np.maximum(light * np.where(seen, calibration.illumination(directions), 0) * noise, 0)
    return as_shot(name, calibration, value)


def as_shot(name: str, calibration: Calibration, value: Array) -> Shot:
    """A grey picture of these values; the calibration that goes with it knows no vignetting."""
    radiance = np.repeat(value[..., None], 3, axis=-1).astype(np.float32)
    image = RadianceImage(
        radiance, np.zeros_like(radiance), np.ones(value.shape, bool), np.zeros(value.shape, bool)
    )
    return Shot(name, image, replace(calibration, vignetting=(), uneven_vignetting=()))


def lamp(calibration: Calibration, towards: Array, width_rad: float = 0.01) -> Array:
    """A lamp of Gaussian profile over a dim background, (H, W)."""
    directions, _ = pixel_directions(calibration)
    angle = np.arccos(np.clip(directions @ towards, -1, 1))
    return 0.2 + 100 * np.exp(-((angle / width_rad) ** 2) / 2)


def scene(calibration: Calibration) -> Array:
    """Light that varies over the sphere by a factor of ten, smoothly, and has a sharp edge."""
    d, _ = pixel_directions(calibration)
    smooth = np.exp(0.8 * np.sin(2 * d[..., 0] + 1) + 0.6 * d[..., 1] * d[..., 2])
    return smooth * np.where(d[..., 0] + 0.3 * d[..., 1] > 0.2, 3.0, 1.0)
