"""Nearest sites by culling, against comparing all."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.cells.nearest_site import nearest_sites, tiled


def unit(random, number):
    vectors = random.standard_normal((number, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


@settings(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    sites=st.integers(1, 80),
    tiles=st.integers(1, 40),
    width=st.sampled_from([0.01, 0.3, 3.0]),
)
def test_agrees_with_comparing_all(seed, sites, tiles, width):
    random = np.random.default_rng(seed)
    centres = np.repeat(unit(random, tiles), 12, axis=0)
    points = centres + width * random.standard_normal(centres.shape)
    points /= np.linalg.norm(points, axis=1)[:, None]
    of_sites = unit(random, sites)
    found = nearest_sites(tiled(points, np.repeat(np.arange(tiles), 12)), of_sites)
    cosines = points @ of_sites.T
    np.testing.assert_allclose(
        cosines[np.arange(len(points)), found], cosines.max(axis=1), atol=1e-12
    )
