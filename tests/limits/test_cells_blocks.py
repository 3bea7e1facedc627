"""Sources closer than a block of cells are one light.

Claim    : maps of more than 256 rows are summed over blocks of cells, which are never cut.
Setup    : four lit cells of a map of 512 rows, inside one block of 2 × 2 and in four blocks.
Expected : one light at their centroid with all of their light, as wide as they are; and four.
Measured : as expected. A block is 0.7° wide, little more than the sun.
"""

import numpy as np
import pytest

from lighting.reduce import reduce_to_lights
from lighting.sphere.latlong import cell_directions
from tests.environments import environment


@pytest.mark.parametrize(("row", "column", "expected"), [(200, 300, 1), (201, 301, 4)])
@pytest.mark.parametrize("method", ["median-cut", "variance-minimisation", "cells"])
def test_four_cells_are_as_many_lights_as_blocks(method, row, column, expected):
    radiance = np.zeros((512, 1024))
    radiance[row : row + 2, column : column + 2] = 1.0
    environment_map = environment(radiance)
    lights = reduce_to_lights(environment_map, 4, method)
    assert len(lights) == expected
    np.testing.assert_allclose(lights.irradiance.sum(axis=0), environment_map.integral(), rtol=1e-6)
    middle = cell_directions(512)[row : row + 2, column : column + 2].mean(axis=(0, 1))
    middle /= np.linalg.norm(middle)
    assert (lights.directions @ middle > np.cos(np.radians(0.3))).all()
    assert (lights.angular_radius_rad < np.radians(0.5)).all()
