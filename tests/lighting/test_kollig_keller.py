"""Cells of relaxed lights: none without light, each around its own light."""

import numpy as np
import pytest

from lighting.blocks.summed_area import block_sums
from lighting.methods import kollig_keller
from lighting.reduce import METHODS
from tests.environments import constant, outdoors


def test_two_lights_in_one_place_each_get_a_cell():
    sums, points, _ = kollig_keller._lit_blocks(block_sums(constant().radiance))
    sites = np.array([[0.0, 1.0, 0.0]] * 3 + [[0.0, -1.0, 0.0]])
    labels = kollig_keller._around(sums, points, sites)
    assert (np.bincount(labels, minlength=4) > 0).all()


@pytest.mark.parametrize("method", ["lloyd", "kollig-keller"])
def test_relaxed_cells_of_an_even_sky_are_alike(method):
    # The spread of cells' light is that of a good start at most.
    _, irradiance, _ = METHODS[method](constant(64), 48)
    assert irradiance[:, 1].std() < 0.25 * irradiance[:, 1].mean()


def test_grown_lights_are_narrower_than_those_of_the_median_cut():
    # Relaxed cells are rounder than rectangles, so their light is less spread: in the mean by power
    # their discs are smaller than those of the median cut.
    def mean_radius(method):
        _, irradiance, radius_rad = METHODS[method](outdoors(64), 64)
        return np.average(radius_rad, weights=irradiance[:, 1])

    assert mean_radius("kollig-keller") < mean_radius("median-cut")
