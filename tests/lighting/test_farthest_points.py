"""Farthest-point strata: trying all points at every step as the oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.cells.farthest_points import farthest_point_strata


def plain_strata(positions, regions, seats):
    """Return strata by trying all points of a region for each centre."""
    strata = np.empty(len(positions), np.int64)
    before = 0
    for region, number in enumerate(seats):
        points = np.flatnonzero(regions == region)
        centres = [points[0]]
        while True:
            away = np.linalg.norm(positions[points, None] - positions[centres], axis=-1)
            if len(centres) == number:
                break
            centres.append(points[np.argmax(away.min(axis=1))])
        strata[points] = before + np.argmin(away, axis=1)
        before += number
    return strata


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 200), number=st.integers(1, 5))
def test_agrees_with_trying_all(seed, count, number):
    rng = np.random.default_rng(seed)
    positions = rng.standard_normal((count, 3))
    positions /= np.linalg.norm(positions, axis=1)[:, None]
    regions = np.append(rng.integers(0, number, count - 1), number - 1)
    # Buckets by octant, and points by bucket: the first of a region is the first of both.
    buckets = (positions > 0) @ [4, 2, 1]
    order = np.argsort(buckets, kind="stable")
    positions, regions, buckets = positions[order], regions[order], buckets[order]
    size = np.bincount(regions, minlength=number)
    seats = np.where(size > 0, rng.integers(1, np.maximum(size, 1) + 1), 0)
    strata = farthest_point_strata(positions, regions, buckets, seats)
    present = np.flatnonzero(size)
    expected = plain_strata(positions, np.searchsorted(present, regions), seats[present])
    np.testing.assert_array_equal(strata, expected)


@pytest.mark.parametrize("bucket_count", [1, 7, 400])
def test_buckets_change_nothing_but_the_time(bucket_count):
    rng = np.random.default_rng(0)
    positions = rng.standard_normal((400, 3))
    positions /= np.linalg.norm(positions, axis=1)[:, None]
    regions = np.zeros(400, np.int64)
    buckets = np.arange(400) * bucket_count // 400
    strata = farthest_point_strata(positions, regions, buckets, np.array([50]))
    np.testing.assert_array_equal(strata, plain_strata(positions, regions, [50]))


def test_as_many_strata_as_points_are_one_point_each():
    positions = np.eye(3)
    strata = farthest_point_strata(
        positions, np.zeros(3, np.int64), np.zeros(3, np.int64), np.array([3])
    )
    np.testing.assert_array_equal(np.sort(strata), [0, 1, 2])
