"""What is assumed about unseen directions, on blocks: as on a map, and by hand."""

import numpy as np
import pytest

from capture.errors import InputError
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.fill import fill_blocks, fill_unseen
from lighting.blocks.summed_area import block_sums
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import solid_angles

FILLS = pytest.mark.parametrize("fill", ["mean", "mirror"])


def sky(rows):
    """Return the solid angle of blocks, (rows, 1)."""
    return solid_angles(rows)[:, None]


def half_seen(rows=8, seed=0):
    """Return a map of noise, each cell seen or not at random and clipped or not, and its blocks."""
    rng = np.random.default_rng(seed)
    seen = rng.random((rows, 2 * rows)) < 0.6
    radiance = rng.lognormal(0, 1, (rows, 2 * rows, 3)).astype(np.float32) * seen[..., None]
    clipped = seen & (rng.random(seen.shape) < 0.2)
    sums = block_sums(radiance)
    environment = EnvironmentMap(radiance, seen, clipped)
    return environment, BlockSums(sums, ~seen * sky(rows), sums[..., 0] * clipped)


@FILLS
def test_blocks_are_filled_as_cells_are(fill):
    environment, blocks = half_seen()
    expected = fill_unseen(environment, fill)
    filled = fill_blocks(blocks, fill)
    sums = block_sums(expected.radiance)
    np.testing.assert_allclose(filled.sums, sums, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(filled.clipped, sums[..., 0] * expected.clipped, rtol=1e-6)
    np.testing.assert_array_equal(filled.unseen_sr, blocks.unseen_sr)


@FILLS
def test_what_was_seen_everywhere_stays_as_it_is(fill):
    sums = block_sums(np.ones((8, 16, 3), np.float32))
    blocks = BlockSums(sums, np.zeros((8, 16)), np.zeros((8, 16)))
    assert fill_blocks(blocks, fill) is blocks


def test_black_adds_nothing():
    _, blocks = half_seen()
    assert fill_blocks(blocks, "black") is blocks


@FILLS
def test_blocks_seen_in_part_are_filled_for_the_rest(fill):
    # Of radiance 2; of the row at the upper pole too little is seen to be mirrored.
    share = np.repeat([0.25, 1, 1, 1, 0.75, 0.25, 0, 0], 16).reshape(8, 16)
    even = block_sums(np.full((8, 16, 3), 2, np.float32))
    filled = fill_blocks(
        BlockSums(even * share[..., None], (1 - share) * sky(8), np.zeros((8, 16))), fill
    )
    np.testing.assert_allclose(filled.sums, even, rtol=1e-12, atol=1e-12)


def test_a_sun_is_mirrored_with_its_place_and_its_clipping():
    sums = np.zeros((8, 16, 7))
    direction = np.array([0.6, 0.64, 0.48])
    sums[1, 3] = 5, *(5 * direction), 5, 5, 5
    unseen = np.repeat([0.0, 1.0], 64).reshape(8, 16)
    filled = fill_blocks(BlockSums(sums, unseen * sky(8), sums[..., 0] * 1.0), "mirror")
    np.testing.assert_allclose(filled.sums[6, 3, 1:4], 5 * direction * (1, -1, 1))
    assert filled.clipped[6, 3] == pytest.approx(5)
    assert filled.clipped_fraction == pytest.approx(1)
    np.testing.assert_allclose(filled.integral(), 10)


def test_light_in_a_sliver_is_not_multiplied_by_its_mirror():
    # A lamp in a block of which an eighth is seen: eight lamps below would be a poor guess.
    sums = np.zeros((8, 16, 7))
    sums[1, 3] = 5, 0, 5, 0, 5, 5, 5
    unseen = np.repeat([0.0, 1.0], 64).reshape(8, 16)
    unseen[1, 3] = 0.875
    blocks = BlockSums(sums, unseen * sky(8), np.zeros((8, 16)))
    filled, by_mean = fill_blocks(blocks, "mirror"), fill_blocks(blocks, "mean")
    np.testing.assert_allclose(filled.sums[6, 3], by_mean.sums[6, 3])
    assert filled.sums[6, 3, 0] < 0.1


def test_the_mean_is_that_of_the_seen_solid_angle():
    # The row at the upper pole, of radiance 3, is all that was seen.
    radiance = np.zeros((4, 8, 3), np.float32)
    radiance[0] = 3
    unseen_sr = np.repeat(sky(4), 8, axis=1)
    unseen_sr[0] = 0
    filled = fill_blocks(BlockSums(block_sums(radiance), unseen_sr, np.zeros((4, 8))), "mean")
    np.testing.assert_allclose(filled.integral(), 4 * np.pi * 3, rtol=1e-12)
    np.testing.assert_allclose(filled.sums[2, :, 4], 3 * solid_angles(4)[2], rtol=1e-12)


@FILLS
def test_nothing_seen_cannot_be_filled(fill):
    nothing = BlockSums(np.zeros((4, 8, 7)), np.repeat(sky(4), 8, axis=1), np.zeros((4, 8)))
    with pytest.raises(InputError, match=f"nothing of the sphere was seen.*{fill}"):
        fill_blocks(nothing, fill)


def test_another_fill_is_refused():
    _, blocks = half_seen()
    with pytest.raises(InputError, match="black, mean, mirror, got grey"):
        fill_blocks(blocks, "grey")


def test_sums_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"\(N, 2N, 7\)"):
        BlockSums(np.zeros((4, 4, 7)), np.zeros((4, 4)), np.zeros((4, 4)))
    with pytest.raises(ValueError, match="unseen_sr"):
        BlockSums(np.zeros((4, 8, 7)), np.zeros((4, 4)), np.zeros((4, 8)))
