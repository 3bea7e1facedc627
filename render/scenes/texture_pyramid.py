"""Textures as pyramids, and their colours for compiled loops.

Input  : pictures, linear.    Output : colours at texture coordinates, as sharp as a pixel allows.
Fails  : a pixel that sees a surface at a slant gets the blur of its longer side in both directions.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_FLOATS = NDArray[np.float32]


def pyramid(picture: _FLOATS) -> list[_FLOATS]:
    """Return the picture and its halves down to one texel; odd rows and columns lose their last."""
    levels = [picture]
    while max(levels[-1].shape[:2]) > 1:
        above = levels[-1]
        for axis in (0, 1):
            length = above.shape[axis] // 2
            if length:
                even, odd = (np.take(above, np.arange(length) * 2 + i, axis) for i in (0, 1))
                above = 0.5 * (even + odd)
        levels.append(above)
    return levels


@njit(nogil=True, error_model="numpy")
def texture_colour(
    texture: NDArray[np.int64], texels: _FLOATS, s: float, t: float, footprint: Any
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a texture's colour at (s, t), repeated, as sharp as the footprint of a pixel allows.

    Bilinear in the two levels whose texels are next in size to `footprint`, a length in texture
    coordinates, and linear between them.
    """
    wanted = footprint * math.sqrt(texture[1] * texture[2])
    level = min(max(math.log2(max(wanted, 1e-9)), 0.0), texture[3] - 1.0)
    fine = int(level)
    red, green, blue = _bilinear(texture, texels, s, t, fine)
    share = level - fine
    if share > 0:
        r, g, b = _bilinear(texture, texels, s, t, fine + 1)
        red, green, blue = (
            red + share * (r - red),
            green + share * (g - green),
            blue + share * (b - blue),
        )
    return red, green, blue


@njit(nogil=True, error_model="numpy")
def _bilinear(
    texture: NDArray[np.int64], texels: _FLOATS, s: float, t: float, level: int
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    first, width, height = texture[0], texture[1], texture[2]
    for _ in range(level):
        first += width * height
        width, height = max(width // 2, 1), max(height // 2, 1)
    x, y = s * width - 0.5, t * height - 0.5
    column, row = math.floor(x), math.floor(y)
    right, up = x - column, y - row
    red = green = blue = 0.0
    for j in range(2):
        for i in range(2):
            at = first + (int(row) + j) % height * width + (int(column) + i) % width
            weight = (right if i else 1 - right) * (up if j else 1 - up)
            red += weight * texels[at, 0]
            green += weight * texels[at, 1]
            blue += weight * texels[at, 2]
    return red, green, blue
