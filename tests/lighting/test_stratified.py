"""Stratified random points: one to each stratum, and lights that are right in the mean."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.methods.stratified import sample_directions, stratified_points, stratified_random
from tests.chi2 import z_score
from tests.environments import constant, environment, outdoors


def strata(points):
    """Return the stratum of each point: rows of the second coordinate, then along the first."""
    count = len(points)
    row_count = round(np.sqrt(count))
    ends = np.array([(row + 1) * count // row_count for row in range(row_count)])
    per_row = np.diff(ends, prepend=0)
    row = np.searchsorted(ends / count, points[:, 1], side="right")
    return ends[row] - per_row[row] + (points[:, 0] * per_row[row]).astype(int)


@settings(deadline=None, max_examples=60)
@given(count=st.integers(1, 3000), seed=st.integers(0, 2**32 - 1))
def test_each_stratum_has_one_point(count, seed):
    points = stratified_points(count, np.random.default_rng(seed))
    assert points.shape == (count, 2)
    assert (points >= 0).all()
    assert (points < 1).all()
    np.testing.assert_array_equal(np.sort(strata(points)), np.arange(count))


class LargestNumbers:
    """In place of a generator: the largest random numbers there are."""

    @staticmethod
    def random(shape):
        return np.full(shape, np.nextafter(1.0, 0.0))


@pytest.mark.parametrize("count", [1, 2, 7, 64, 3000])
def test_points_stay_inside_the_square(count):
    # 1 + 0.999… rounds to 2: without care a point would be at the end of the square.
    assert stratified_points(count, LargestNumbers).max() < 1


def test_a_point_is_uniform_in_its_stratum():
    # Of 1000 sets of 7 points, each coordinate's place within its stratum is uniform: its mean is
    # ½ ± 0.0035 and its mean square ⅓.
    rng = np.random.default_rng(0)
    x, y = np.concatenate([stratified_points(7, rng) for _ in range(1000)]).T
    rows = np.where(y < 2 / 7, 0, np.where(y < 4 / 7, 1, 2))
    depth = np.choose(rows, [y * 3.5, (y - 2 / 7) * 3.5, (y - 4 / 7) * 7 / 3])
    along = x * np.choose(rows, [2, 2, 3]) % 1
    for place in (depth, along):
        assert abs(z_score(place, 1 / 2)) < 4
        assert abs(z_score(place**2, 1 / 3)) < 4


def test_lights_are_right_in_the_mean_over_seeds():
    # A grey map needs no correction of colour, so every light is Φ/n exactly and the irradiance on
    # any surface, π under an even sky, is estimated without bias.
    normal = np.array([0.48, 0.6, 0.64])
    received = []
    for seed in range(400):
        directions, irradiance, _ = stratified_random(constant(), 13, seed=seed)
        received.append(np.clip(directions @ normal, 0, None) @ irradiance[:, 1])
    assert abs(z_score(np.array(received), np.pi)) < 4


def test_other_seeds_give_other_lights():
    first, _, _ = stratified_random(outdoors(16), 16)
    second, _, _ = stratified_random(outdoors(16), 16, seed=1)
    assert (first != second).all()


def test_sampling_a_map_without_light_is_refused():
    with pytest.raises(ValueError, match="without light"):
        sample_directions(environment(np.zeros((4, 8))), 4, np.random.default_rng(0))
