"""Products of transport and light against plain sums."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from render.baked.transport import Colours, NarrowTransport, Transport
from render.baked.transport_kernel import TILE

TILES, MIRRORING = 5, np.array([1, 3])


@pytest.fixture
def rng():
    return np.random.default_rng(4)


@pytest.mark.parametrize("dark", [(), (0,), (2, 5, 6)])
def test_cells_that_shine_are_summed_whatever_their_number(rng, dark):
    matt = rng.integers(0, 256, (TILES, 7, TILE), dtype=np.uint8)
    mirror = rng.integers(0, 256, (2, 7, TILE), dtype=np.uint8)
    matt_scale = rng.random((TILES, 3, TILE), np.float32)
    mirror_scale = rng.random((2, 3, TILE), np.float32)
    light, mirrored = rng.random((2, 7, 3))
    light[list(dark)] = 0
    picture = np.ones((TILES, 3, TILE), np.float32)
    Transport(matt, matt_scale, MIRRORING, mirror, mirror_scale).add(light, mirrored, picture)
    truth = 1 + matt_scale * np.einsum("tdi,dc->tci", matt, light)
    truth[MIRRORING] += mirror_scale * np.einsum("tdi,dc->tci", mirror, mirrored)
    assert_allclose(picture, truth, rtol=1e-5)


@pytest.mark.parametrize("count", [0, 1, 8])
def test_narrow_lights_are_summed_whatever_their_number(rng, count):
    matt = rng.random((count, TILES, TILE), np.float32)
    mirror = rng.random((count, 2, TILE), np.float32)
    colours = Colours(
        rng.random((TILES, 3, TILE), np.float32),
        MIRRORING,
        rng.random((2, 3, TILE), np.float32),
    )
    irradiance, mirrored = rng.random((2, count, 3))
    picture = np.ones((TILES, 3, TILE), np.float32)
    narrow = [NarrowTransport(*each) for each in zip(matt, mirror, strict=True)]
    colours.add(narrow, irradiance, mirrored, picture)
    truth = 1 + colours.matt * np.einsum("kti,kc->tci", matt, irradiance)
    truth[MIRRORING] += colours.mirror * np.einsum("kti,kc->tci", mirror, mirrored)
    assert_allclose(picture, truth, rtol=1e-5)
