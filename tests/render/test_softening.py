"""Means over tiles of what rays saw, against those worked out one by one."""

import numpy as np
import pytest

from render.moving.shadow_rays import ALL_PASSES, UNKNOWN
from render.moving.softening import soften
from render.rays.surface_rows import GROUND, KIND, LANES, NORMAL, NOTHING, POSITION, empty_surfaces

WEIGHTS = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]])
EYE = np.array([0.0, 9.0, 0.0], np.float32)


@pytest.mark.parametrize("slots", [2, 6, 8])
def test_a_mean_is_of_the_like_pixels_of_tiles_that_sent_rays(slots):
    """A tile whose row and column add up to an even number, its diagonals; or the four beside."""
    rng = np.random.default_rng(slots)
    surfaces, level = random_levels(rng)
    rows, _, _, columns = surfaces.shape
    shared = ALL_PASSES * rng.integers(0, 2, (rows, LANES, columns, slots), np.uint8)
    is_open = rng.random((rows, columns)) < 0.3
    softened = np.zeros_like(shared)
    soften(surfaces, is_open, shared, EYE, 1e-3, 4, 15, softened)
    unknown = 0
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            around = np.ix_(range(row - 1, row + 2), range(column - 1, column + 2))
            sent = np.add.outer(np.arange(row - 1, row + 2), np.arange(column - 1, column + 2)) % 2
            for lane in range(15):  # the last has no turn
                if level[row, lane, column] == 0:
                    continue
                like = level[:, lane][around] == level[row, lane, column]
                weights = WEIGHTS * (sent == 0) * (like | is_open[row, column])
                total = np.einsum("rc,rcs->s", weights, shared[:, lane][around].astype(int))
                mean = np.floor(total / max(weights.sum(), 1) + 0.5)
                expected = mean if weights.any() else np.full(slots, UNKNOWN)
                np.testing.assert_array_equal(softened[row, lane, column], expected)
                unknown += not weights.any()
    assert unknown
    assert not softened[:, 15].any()


def random_levels(rng):
    """Return surfaces at one of two heights, or none at all, and which: 0 stands for none."""
    surfaces = empty_surfaces((128, 32))
    rows, lanes, _, columns = surfaces.shape
    level = rng.choice([0, 1, 2], (rows, lanes, columns), p=[0.2, 0.6, 0.2])
    level[[0, -1]] = level[..., [0, -1]] = 0
    surfaces[:, :, POSITION] = rng.random(level.shape)
    surfaces[:, :, POSITION + 1] = level
    surfaces[:, :, NORMAL + 1] = 1
    surfaces[:, :, KIND] = np.where(level > 0, GROUND, NOTHING)
    return surfaces, level
