"""The cells of a lat-long grid that a disc on the sphere lies in.

Input  : centre and angular radius of the disc.    Output : the share of the disc in each cell.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.photometry.illuminance import unit
from lighting.sphere.latlong import direction_to_grid

_POINTS = 4096
_GOLDEN_RAD = np.pi * (3 - np.sqrt(5))


def disc_shares(height: int, centre: NDArray[np.float64], radius_rad: float) -> NDArray[np.float64]:
    """Return the share of a disc that lies in each cell, (N, 2N); they sum to 1 at any radius.

    By 4096 points spread evenly over it (a sunflower's). `centre` (3,) is a unit vector.
    """
    order = np.arange(_POINTS)
    cosine = 1 - (1 - np.cos(radius_rad)) * (order + 0.5) / _POINTS
    sine = np.sqrt(1 - cosine**2)
    aside = unit(np.cross(centre, np.eye(3)[np.argmin(np.abs(centre))]))
    across = np.cross(centre, aside)
    turn = order * _GOLDEN_RAD
    points = (
        cosine[:, None] * centre
        + (sine * np.cos(turn))[:, None] * aside
        + (sine * np.sin(turn))[:, None] * across
    )
    column, row = np.rint(direction_to_grid(points, height)).astype(int).T
    cells = np.clip(row, 0, height - 1) * 2 * height + column % (2 * height)
    counts = np.bincount(cells, minlength=2 * height**2).reshape(height, -1)
    return np.asarray(counts / _POINTS, np.float64)
