"""Two lamps within one cap are one key light.

Claim    : a key light gathers what stands out within 4° of its centre. Two lamps that are closer
           are one light between them or, wider than a key light may be, left to cells; farther
           apart each is its own.
Setup    : two lamps of 0.3° radius, each as much light as the sky, 2° to 16° apart, 128 rows.
Expected : one light within 0.03° of the centroid at 2°, none at 3° to 4°; two that are off by 0.05°
           at most from 10° on; in between no light is lost, whatever takes it.
Measured : at 2° one, of 1.8° radius; at 3° none.
"""

import numpy as np
import pytest

from lighting.adaptive.key_lights import KeyLights, take_key_lights
from lighting.blocks.block_grid import block_grid
from lighting.blocks.summed_area import block_sums
from lighting.simulation.sequences import Sequence, Source, frames


def lamps(apart_deg):
    """Return the key lights, the directions of two lamps, and the light of the map."""
    middle, across = np.array([0.48, 0.6, 0.64]), np.array([0.8, 0.0, -0.6])
    half = np.radians(apart_deg) / 2
    directions = [np.cos(half) * middle + side * np.sin(half) * across for side in (1, -1)]
    sources = tuple(Source(1.0, lambda _, d=d: d, np.radians(0.3)) for d in directions)
    timed = next(iter(frames(Sequence(sources), 128, 1)))
    blocks = block_sums(timed.environment.radiance)
    keys = take_key_lights(blocks, block_grid(128), 0.01, 8, np.empty((0, 3)))
    return keys, np.array([source.direction for source in timed.sources]), blocks[..., 4:]


def off_deg(keys: KeyLights, directions):
    chord = np.linalg.norm(keys.directions[:, None] - directions, axis=-1)
    return np.degrees(2 * np.arcsin(chord / 2)).min(axis=1)


def test_two_close_lamps_are_one_light_between_them():
    keys, directions, _ = lamps(2.0)
    middle = directions.sum(axis=0)
    assert len(keys.directions) == 1
    assert off_deg(keys, middle / np.linalg.norm(middle)).max() < 0.03
    assert 0.8 < np.degrees(keys.angular_radius_rad[0]) < 2.0


@pytest.mark.parametrize("apart_deg", [3.0, 4.0])
def test_two_lamps_that_together_are_wide_are_left_to_cells(apart_deg):
    assert len(lamps(apart_deg)[0].directions) == 0


@pytest.mark.parametrize("apart_deg", [10.0, 12.0, 16.0])
def test_lamps_farther_apart_are_two(apart_deg):
    keys, directions, _ = lamps(apart_deg)
    assert len(keys.directions) == 2
    assert off_deg(keys, directions).max() < 0.05


@pytest.mark.parametrize("apart_deg", [2.0, 4.0, 5.0, 6.0, 7.0, 8.0, 16.0])
def test_whatever_takes_it_no_light_is_lost(apart_deg):
    keys, _, radiance = lamps(apart_deg)
    total = keys.irradiance.sum(axis=0) + keys.rest[..., 4:].sum(axis=(0, 1))
    np.testing.assert_allclose(total, radiance.sum(axis=(0, 1)), rtol=1e-9)
