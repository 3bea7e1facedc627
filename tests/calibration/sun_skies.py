"""Pictures of a sky with the sun in it, through a lens and in a pose that are known."""

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.models.equidistant import Equidistant

LENS = Equidistant((159.5, 151.5), 95.0)
SIZE_PX = (320, 300)
FULL = 250.0


def camera(R_world_camera: NDArray[np.float64]) -> Calibration:
    """Return a camera that sees a hemisphere, 0.6° a pixel."""
    return Calibration(LENS, SIZE_PX, np.pi / 2, R_world_camera)


def sky(
    model: Calibration, sun: NDArray[np.float64], *, glare: float = 60.0, sky_level: float = 70.0
) -> NDArray[np.uint8]:
    """Return counts (H, W, 3): a blue sky whose glare about the sun is clipped, 3° or so wide.

    `sun` is its world direction; a `glare` of 0 leaves it out.
    """
    width, height = model.image_size_px
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    directions, seen = model.unproject(grid)
    away = np.degrees(np.arccos(np.clip(np.nan_to_num(directions) @ sun, -1, 1)))
    light = sky_level + 10 * directions[..., 1] + glare * 30 / (1 + (away / 0.8) ** 2) ** 1.2
    counts = np.stack([light, 1.1 * light, 1.6 * light], axis=-1)
    return np.where(seen[..., None], np.clip(np.round(np.nan_to_num(counts)), 0, 255), 0).astype(
        np.uint8
    )


def add_cloud(
    counts: NDArray[np.uint8],
    centre_px: tuple[float, float],
    radii_px: tuple[float, float],
    level: int = 255,
) -> NDArray[np.uint8]:
    """Return the picture with a white elliptical cloud in it, nowhere darker than before."""
    rows, columns = np.indices(counts.shape[:2])
    inside = np.hypot((columns - centre_px[0]) / radii_px[0], (rows - centre_px[1]) / radii_px[1])
    return np.where((inside < 1)[..., None], np.maximum(counts, np.uint8(level)), counts)
