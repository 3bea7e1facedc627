"""Points on discs such that any few in a row are spread over them: for pixels that take turns.

Domain : any number of lights, angular radius 0 to π/2.
Cost   : about 0.2 ms for 64 discs of 32 points.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BITS = 16


def disc_net(directions: Array, radius_rad: Array, count: int) -> Array:
    """Return `count` unit directions on each disc, (K, count, 3), evenly in solid angle.

    Each 2ᵐ in a row, from a multiple of 2ᵐ on, have one point in each of 2ᵐ equal parts of a square
    cut in any way into rectangles [1]_; the concentric map bends the square to a disc.

    Parameters
    ----------
    directions, radius_rad : (K, 3), (K,) float64
    count : int
        A power of 2.

    References
    ----------
    .. [1] T. Kollig, A. Keller, "Efficient Multidimensional Sampling", Computer Graphics Forum
           21(3), 2002: (0, 2)-sequences in base 2.
    """
    a, b = 2 * _net(count).T - 1
    is_wide = np.abs(a) > np.abs(b)
    ratio = np.where(is_wide, b, a) / np.where(is_wide, a, b)
    angle = np.where(is_wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    signed = np.where(is_wide, a, b)
    height = 1 - (1 - np.cos(radius_rad))[:, None] * signed**2
    level = np.sign(signed) * np.sqrt(np.maximum(1 - height**2, 0.0))
    along = np.cross(directions, np.eye(3)[np.argmin(np.abs(directions), axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(directions, along)
    return (
        height[..., None] * directions[:, None]
        + (level * np.cos(angle))[..., None] * along[:, None]
        + (level * np.sin(angle))[..., None] * across[:, None]
    )


def _net(count: int) -> Array:
    """Return the first points of Sobol's sequence in two dimensions, (count, 2), within cells."""
    index = np.arange(count)
    points = np.zeros((count, 2), np.int64)
    second = 1 << (_BITS - 1)
    for bit in range(_BITS):
        is_set = (index >> bit & 1).astype(bool)
        points[is_set, 0] ^= 1 << (_BITS - 1 - bit)
        points[is_set, 1] ^= second
        second ^= second >> 1
    return points / 2**_BITS + 0.5 / count
