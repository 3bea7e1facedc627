"""Median cut passes through the brightest source.

Claim    : a cut into equal halves of light goes through a source that has more than half of it, and
           one half is then joined with whatever else is on its side.
Setup    : two lamps of 4 × 4 cells in the dark, 77° apart, one 6 times the other, in a map of 32
           rows; two lights.
Expected : the halves nearest to 3.5 : 3.5 in whole columns, half the bright lamp, and its other
           half with the dim one, 3 : 4. The latter's light is a quarter of the way to the dim lamp.
           The other methods give each lamp its own light (tests/lighting/test_cell_methods.py).
Measured : as expected; that light is 21° from the bright lamp and 56° from the dim one.
"""

import numpy as np
import pytest

from lighting.reduce import reduce_to_lights
from lighting.sphere.latlong import cell_directions
from tests.environments import environment


def test_a_light_stands_between_the_lamps():
    radiance = np.zeros((32, 64))
    radiance[12:16, 10:14], radiance[12:16, 24:28] = 6.0, 1.0
    lights = reduce_to_lights(environment(radiance), 2, "median-cut")
    lone, joined = np.argsort(lights.irradiance[:, 0])
    assert lights.irradiance[joined] / lights.irradiance[lone] == pytest.approx(4 / 3, rel=1e-6)
    bright, dim = (cell_directions(32)[12:16, c : c + 4].mean(axis=(0, 1)) for c in (10, 24))
    off_bright, off_dim = (
        np.degrees(np.arccos(lights.directions[joined] @ lamp / np.linalg.norm(lamp)))
        for lamp in (bright, dim)
    )
    assert off_bright == pytest.approx(21.3, abs=0.2)
    assert off_dim == pytest.approx(56, abs=2)
