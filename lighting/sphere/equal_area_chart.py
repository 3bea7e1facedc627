"""HEALPix's chart of the sphere: equal areas, straight in the middle, four gores at either pole.

Domain : the sphere, poles at ±Y. Turns are quarter turns of azimuth, 0 … 4, heights are cos θ.
Output : t, 0 … 4, and u, −1 … 1. Between |cos θ| = ⅔ t is the turn; beyond, each quarter narrows
         to a point.
Fails  : across the cut between two gores near places are far apart on the chart.

References
----------
.. [1] K. M. Górski et al., "HEALPix: A Framework for High-Resolution Discretization and Fast
       Analysis of Data Distributed on the Sphere", The Astrophysical Journal 622, 2005.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def on_chart(turn: Array, height: Array) -> tuple[Array, Array]:
    """Return t and u (n,) of points on the sphere; `on_sphere` undoes it."""
    width = np.minimum(np.sqrt(3 * np.maximum(1 - np.abs(height), 0)), 1)  # of a gore
    middle = np.minimum(np.floor(turn), 3) + 0.5
    is_straight = width == 1
    t = np.where(is_straight, turn, middle + (turn - middle) * width)
    return t, np.where(is_straight, 0.75 * height, np.sign(height) * (1 - width / 2))


def on_sphere(t: Array, u: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return turn and height (n,) of points of the plane, and which of them are on the chart."""
    width = np.minimum(2 * (1 - np.abs(u)), 1)  # of a gore
    middle = np.floor(t) + 0.5
    aside = t - middle
    is_in = (t >= 0) & (t < 4) & (width > 0) & (np.abs(aside) < width / 2)
    turn = middle + aside / np.where(is_in, width, 1)
    height = np.where(np.abs(u) <= 0.5, 4 / 3 * u, np.sign(u) * (1 - width**2 / 3))
    return turn, height, is_in


def directions_of(turn: Array, height: Array) -> Array:
    """Return unit vectors (n, 3) in the world frame; turns go as the columns of a lat-long map."""
    level = np.sqrt((1 - height) * (1 + height))
    phi = np.pi * (1 - turn / 2)
    return np.stack([level * np.sin(phi), height, level * np.cos(phi)], axis=-1)
