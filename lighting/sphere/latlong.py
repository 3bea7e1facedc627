"""The lat-long grid: N × 2N cells over the sphere, in OpenEXR's orientation.

Cell (r, c) has its centre at θ = π (r + ½)/N from +Y and φ = π − 2π (c + ½)/2N, and
d = (sin θ sin φ, cos θ, sin θ cos φ): the map's centre is +Z, +X stands at a quarter of its width,
row 0 touches +Y. Grid coordinates (column, row) are continuous, with integers at cell centres.
"""

import numpy as np
from numpy.typing import NDArray


def solid_angles(height: int) -> NDArray[np.float64]:
    """Return the exact solid angle of a cell of each row, (height,), in sr.

    Ω = (π/N)(cos θ_top − cos θ_bottom); over all cells they sum to 4π.
    """
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    return (np.pi / height) * (edges[:-1] - edges[1:])


def cell_directions(height: int) -> NDArray[np.float64]:
    """Return the unit world direction of each cell's centre, (height, 2 height, 3)."""
    rows, columns = np.mgrid[0:height, 0 : 2 * height].astype(np.float64)
    return grid_to_direction(np.stack([columns, rows], axis=-1), height)


def grid_to_direction(coordinates: NDArray[np.floating], height: int) -> NDArray[np.float64]:
    """Return unit world directions (..., 3) of grid coordinates (column, row) (..., 2)."""
    coordinates = np.asarray(coordinates, np.float64)
    theta = np.pi * (coordinates[..., 1] + 0.5) / height
    phi = np.pi - np.pi * (coordinates[..., 0] + 0.5) / height
    sin_theta = np.sin(theta)
    return np.stack([sin_theta * np.sin(phi), np.cos(theta), sin_theta * np.cos(phi)], axis=-1)


def direction_to_grid(directions: NDArray[np.floating], height: int) -> NDArray[np.float64]:
    """Return grid coordinates (column, row) (..., 2) of world directions (..., 3).

    Directions need not have unit length. The column lies in [−½, 2N − ½); at the poles, where every
    column meets, it is the one of φ = 0.
    """
    directions = np.asarray(directions, np.float64)
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    theta = np.arctan2(np.hypot(x, z), y)
    phi = np.arctan2(x, z)
    column = (np.pi - phi) * height / np.pi - 0.5
    column = np.where(column >= 2 * height - 0.5, column - 2 * height, column)
    return np.stack([column, theta * height / np.pi - 0.5], axis=-1)
