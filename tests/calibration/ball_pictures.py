"""Pictures of a mirror ball by ray tracing, with the true direction of every pixel.

Input  : a pinhole camera at the origin (+z forward, +y down), and where the ball of radius 1 is.
Nothing is shared with the mirror-ball models: rays are intersected and reflected as vectors.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_CHUNK_ROWS = 64


@dataclass(frozen=True)
class BallScene:
    """A pinhole's focal length and principal point, the ball's centre in radii, and the picture."""

    focal_px: float
    principal_px: tuple[float, float]
    centre: tuple[float, float, float]
    size_px: tuple[int, int]

    @property
    def distance_ratio(self) -> float:
        return float(np.linalg.norm(self.centre))


def scene_of(
    distance_ratio: float,
    radius_px: float,
    size_px: tuple[int, int],
    off_axis_rad: float = 0.0,
    shift_px: tuple[float, float] = (0.3, -0.4),
) -> BallScene:
    """A ball whose outline has about `radius_px`, near the middle of the picture's frame."""
    focal_px = radius_px * np.sqrt(distance_ratio**2 - 1)
    middle = np.array([(size_px[0] - 1) / 2, (size_px[1] - 1) / 2]) + shift_px
    principal = middle - [focal_px * np.tan(off_axis_rad), 0.0]
    centre = distance_ratio * np.array([np.sin(off_axis_rad), 0.0, np.cos(off_axis_rad)])
    return BallScene(float(focal_px), tuple(principal), tuple(centre), size_px)


def trace(scene: BallScene, pixels: NDArray) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Camera-frame directions (..., 3) that pixels see, and whether in the ball or past it."""
    x = (pixels[..., 0] - scene.principal_px[0]) / scene.focal_px
    y = (pixels[..., 1] - scene.principal_px[1]) / scene.focal_px
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    centre = np.array(scene.centre)
    along = rays @ centre
    discriminant = along**2 - (centre @ centre - 1.0)
    hits = discriminant > 0
    normals = rays * (along - np.sqrt(np.maximum(discriminant, 0)))[..., None] - centre
    reflected = rays - 2 * np.sum(rays * normals, axis=-1, keepdims=True) * normals
    return np.where(hits[..., None], reflected, rays), hits


def room(directions: NDArray) -> NDArray[np.float64]:
    """Radiance (..., 3) of a room all around: bright above, lamps, windows and a textured floor."""
    x, y, z = np.moveaxis(directions, -1, 0)
    base = 0.35 - 0.15 * y + 0.05 * np.sin(7 * x + 3 * z) * np.cos(5 * z - 4 * y)
    walls = 0.15 * (np.sin(3 * np.arctan2(x, z)) > 0.3)
    lamps = np.zeros_like(x)
    for lamp, width in (((0.5, -0.8, -0.3), 0.1), ((-0.6, -0.5, 0.6), 0.15), ((0.2, 0.1, -1), 0.2)):
        cosine = directions @ (np.array(lamp) / np.linalg.norm(lamp))
        lamps += 3.0 + 3.0 * np.tanh((cosine - np.cos(width)) / 0.004)
    grey = base + walls + lamps
    return grey[..., None] * np.array([1.0, 0.95, 0.85]) + 0.02


def backdrop(directions: NDArray) -> NDArray[np.float64]:
    """Radiance (..., 3) behind the ball, a cloth of fine stripes and blotches."""
    x, y = directions[..., 0] / directions[..., 2], directions[..., 1] / directions[..., 2]
    pattern = 0.5 + 0.2 * np.sin(90 * x + 31 * y) * np.sin(57 * y - 20 * x) + 0.15 * np.sin(13 * x)
    return pattern[..., None] * np.array([0.9, 1.0, 1.1]) + 0.05


def photograph(
    scene: BallScene, noise: float = 0.01, seed: int = 0, supersampling: int = 4
) -> NDArray[np.float32]:
    """The linear picture (H, W, 3): the mean over each pixel, with noise relative to 1."""
    width, height = scene.size_px
    steps = (np.arange(supersampling) + 0.5) / supersampling - 0.5
    picture = np.zeros((height, width, 3))
    for first in range(0, height, _CHUNK_ROWS):
        last = min(first + _CHUNK_ROWS, height)
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(first, last)), axis=-1)
        for dy in steps:
            for dx in steps:
                directions, hits = trace(scene, grid + np.array([dx, dy]))
                radiance = backdrop(directions)
                radiance[hits] = room(directions[hits])
                picture[first:last] += radiance
    picture /= supersampling**2
    rng = np.random.default_rng(seed)
    picture += noise * rng.standard_normal(picture.shape)
    return np.maximum(picture, 0).astype(np.float32)
