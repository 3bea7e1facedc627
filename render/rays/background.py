"""The environment behind a scene, without OpenGL: rays of a picture, looked up in a map.

As shaders/background.frag: bilinear between the centres of cells, around the seam, held at a pole.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.photometry.albedo import LEAST_GROUND, ground_radiance
from render.scenes.scene import Camera


def picture_rays(camera: Camera, size_px: tuple[int, int]) -> NDArray[np.float64]:
    """Return the world directions (H, W, 3), not of unit length, of a picture's sample centres."""
    width, height = size_px
    across, up = camera.half_extent()
    x = (2 * np.arange(width) + 1) / width - 1
    y = 1 - (2 * np.arange(height) + 1) / height
    ndc = np.stack([*np.meshgrid(across * x, up * y), np.full((height, width), -1.0)], axis=-1)
    return ndc @ camera.axes()


def map_coordinates(directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return u and v, 0 … 1 and v from the top, in a lat-long map of directions (S, 3): (S, 2)."""
    x, y, z = directions.T
    u = 0.5 - np.arctan2(x, z) / (2 * np.pi)
    v = np.arctan2(np.hypot(x, z), y) / np.pi
    return np.stack([u, v], axis=-1).astype(np.float32)


def seen_ground(environment: EnvironmentMap, stand_in: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean radiance (3,) of the ground in a map; `stand_in` if next to none was seen."""
    radiance, share = ground_radiance(environment)
    return radiance.astype(np.float32) if share >= LEAST_GROUND else stand_in


def with_ground(environment: EnvironmentMap, radiance: NDArray[np.float32]) -> EnvironmentMap:
    """Return the map with a ground's radiance (3,) where nothing was seen below the horizon."""
    filled = environment.radiance.copy()
    _fill_unseen(environment.valid, np.asarray(radiance, np.float32), filled)
    return replace(environment, radiance=filled)


@njit(cache=True, nogil=True)
def _fill_unseen(
    valid: NDArray[np.bool_], colour: NDArray[np.float32], radiance: NDArray[np.float32]
) -> None:  # pragma: no cover - compiled
    for row in range(len(valid) // 2, len(valid)):
        for column in range(valid.shape[1]):
            if not valid[row, column]:
                for c in range(3):
                    radiance[row, column, c] = colour[c]


@njit(cache=True, nogil=True, parallel=True)
def look_up(
    radiance: NDArray[np.float32],
    at: NDArray[np.float32],
    samples: NDArray[np.int64],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover - compiled
    """Set `samples` (S,) of `out` to a map (N, 2N, 3) at (S, 2) as `map_coordinates` gives them."""
    for i in prange(len(at)):
        cells = corners_of(radiance.shape[0], radiance.shape[1], at[i])
        for c in range(3):
            out[samples[i], c] = between(radiance, cells, c)


@njit(cache=True, nogil=True, parallel=True)
def look_through(
    radiance: NDArray[np.float32],
    at: NDArray[np.float32],
    samples: NDArray[np.int64],
    unshaded: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover - compiled
    """Set samples of a ground to what the map shows there, in the shadow that they are in.

    A matt ground, `unshaded` (3,) where nothing stands on it, is replaced by one that has the map's
    radiance there: the ratio of the two holds for any reflectance [1]_.

    References
    ----------
    .. [1] P. Debevec, "Rendering Synthetic Objects into Real Scenes", SIGGRAPH 1998, section 6:
           its difference of two pictures, with the albedo that makes the second one the photograph.
    """
    for i in prange(len(at)):
        cells = corners_of(radiance.shape[0], radiance.shape[1], at[i])
        for c in range(3):
            shade = out[samples[i], c] / unshaded[c] if unshaded[c] > 0 else np.float32(1)
            out[samples[i], c] = shade * between(radiance, cells, c)


@njit(nogil=True, error_model="numpy")
def corners_of(
    rows: int, columns: int, at: Any
) -> tuple[int, int, int, np.float32, np.float32]:  # pragma: no cover - compiled
    """Return the upper of two rows, two columns, and how far to the second of each u, v lies."""
    x = at[0] * np.float32(columns) - np.float32(0.5)
    y = min(max(at[1] * np.float32(rows) - np.float32(0.5), np.float32(0)), np.float32(rows - 1))
    column, row = math.floor(x), min(int(y), rows - 2)
    right, down = x - np.float32(column), y - np.float32(row)
    return row, column % columns, (column + 1) % columns, down, right


@njit(nogil=True)
def between(
    radiance: NDArray[np.float32], corners: tuple[int, int, int, np.float32, np.float32], c: int
) -> np.float32:  # pragma: no cover - compiled
    """Return channel c of a map (N, 2N, 3) between the cells that `corners_of` gives."""
    row, left, beside, down, right = corners
    near, high = np.float32(1) - right, np.float32(1) - down
    above = near * radiance[row, left, c] + right * radiance[row, beside, c]
    below = near * radiance[row + 1, left, c] + right * radiance[row + 1, beside, c]
    return high * above + down * below
