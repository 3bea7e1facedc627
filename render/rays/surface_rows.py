"""Surfaces that a picture shows, ordered for loops that treat 16 pixels at a time.

Pixels come in tiles of 4 × 4. A pixel's place in its tile is its lane, 4 row + column, and the
pixels of one lane in a row of tiles lie side by side: a loop over them runs over neighbours of
neighbours, which do alike. A border of one empty tile saves the loops their borders.
"""

import math

import numpy as np
from numpy.typing import NDArray

LANES = 16
"""Pixels of a tile, and rays of a packet."""

SIDE = 4
"""Pixels along the side of a tile."""

POSITION, NORMAL, FACE_NORMAL, MATT, F0 = 0, 3, 6, 9, 12
F90, ALPHA2, KIND = 15, 16, 17
FIELDS = 18
"""Rows of a surface: position (3), shading normal (3), face normal (3), ρ/π (3), f0 (3), f90, α²
and what it is. Where nothing is hit, `POSITION` is the direction of the ray instead."""

TRIANGLE, U, V = 18, 19, 20
"""Three rows more for those who ask for them: the bits of a triangle's row, −1 off the triangles;
the shares of its second and third corner."""

NOTHING, GROUND, DULL, GLOSSY = 0.0, 1.0, 2.0, 3.0
"""Values of `KIND`: nothing was hit, the ground, a Lambertian surface, one that mirrors too."""

_FLOATS = NDArray[np.float32]


def empty_surfaces(size_px: tuple[int, int], fields: int = FIELDS) -> _FLOATS:
    """Return memory for a picture's surfaces, (rows + 2, LANES, fields, columns + 2) of tiles.

    Columns are a multiple of 16, so a picture may reach over its right and lower edge.
    """
    width, height = size_px
    columns = LANES * math.ceil(width / (SIDE * LANES))
    rows = SIDE * math.ceil(height / SIDE**2)
    return np.zeros((rows + 2, LANES, fields, columns + 2), np.float32)


def in_picture(surfaces: _FLOATS, size_px: tuple[int, int]) -> _FLOATS:
    """Return the surfaces as a picture, (H, W, FIELDS)."""
    width, height = size_px
    inside = surfaces[1:-1, ..., 1:-1]
    rows, _, fields, columns = inside.shape
    lanes = inside.reshape(rows, SIDE, SIDE, fields, columns).transpose(0, 1, 4, 2, 3)
    return lanes.reshape(SIDE * rows, SIDE * columns, fields)[:height, :width]
