"""A point on the grid keeps its light and its direction, and moves without a jump."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.blocks.summed_area import block_sums
from lighting.simulation.point_sources import shares_of_points
from lighting.sphere.latlong import cell_directions, solid_angles


def direction(azimuth, elevation):
    level = np.cos(elevation)
    return np.array([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)])


anywhere = st.builds(direction, st.floats(-np.pi, np.pi), st.floats(-np.pi / 2, np.pi / 2))
SPECIAL = {
    "zenith": (0.0, 1.0, 0.0),
    "nadir": (0.0, -1.0, 0.0),
    "beside the zenith": (1e-9, 1.0, 0.0),
    "seam": (0.0, 0.0, -1.0),
    "a cell's centre": cell_directions(8)[2, 3],
}


def centroid(shares):
    """Return the mean direction of light in the cells, exact over each of them (summed_area.py)."""
    radiance = (shares / solid_angles(len(shares))[:, None])[..., None] * np.ones(3)
    moment = block_sums(radiance.astype(np.float32)).sum(axis=(0, 1))[1:4]
    return moment / np.linalg.norm(moment)


def check(towards, height):
    shares = shares_of_points(np.array([towards]), height)
    assert shares.min() >= 0
    assert shares.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(centroid(shares), towards, atol=1e-6)  # radiance is float32


@settings(deadline=None, max_examples=30)
@given(towards=anywhere, height=st.sampled_from([8, 9, 32]))
def test_light_and_direction_are_kept_anywhere(towards, height):
    check(towards, height)


@pytest.mark.parametrize("towards", SPECIAL.values(), ids=SPECIAL)
def test_light_and_direction_are_kept_at_special_places(towards):
    check(np.array(towards) / np.linalg.norm(towards), 8)


@settings(deadline=None, max_examples=30)
@given(towards=anywhere, step=anywhere)
def test_a_small_step_changes_the_shares_little(towards, step):
    height, step_rad = 16, 1e-5
    there = towards + step_rad * step
    there /= np.linalg.norm(there)
    before, after = (shares_of_points(each[None], height) for each in (towards, there))
    # At the equator a step along rows or columns moves light at 2 · 16/π = 10 a radian; around the
    # poles, where columns crowd, at 79 at most.
    assert np.abs(after - before).sum() < 100 * step_rad


def test_many_points_are_the_mean_of_each():
    towards = np.array([direction(0.3, 0.2), direction(-2.0, 1.5), direction(3.1, -1.2)])
    together = shares_of_points(towards, 16)
    alone = [shares_of_points(each[None], 16) for each in towards]
    np.testing.assert_allclose(together, np.mean(alone, axis=0), atol=1e-15)
