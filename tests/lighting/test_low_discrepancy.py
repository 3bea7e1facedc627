"""The point sequence: what makes it a (0, 2)-sequence, and what the lights need of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.sampling.low_discrepancy import low_discrepancy_points


@settings(deadline=None, max_examples=40)
@given(m=st.integers(0, 10), run=st.integers(0, 7), data=st.data())
def test_aligned_runs_have_one_point_in_every_box_of_any_shape(m, run, data):
    a = data.draw(st.integers(0, m))
    points = low_discrepancy_points((run + 1) << m)[run << m :]
    boxes = np.floor(points * [2**a, 2 ** (m - a)]).astype(int)
    assert len(np.unique(boxes, axis=0)) == 2**m


@settings(deadline=None, max_examples=40)
@given(few=st.integers(1, 2000), more=st.integers(1, 2000))
def test_fewer_points_are_the_first_of_more(few, more):
    few, more = sorted((few, more))
    assert np.array_equal(low_discrepancy_points(few), low_discrepancy_points(more)[:few])


def test_points_lie_in_the_half_open_square():
    points = low_discrepancy_points(65536)
    assert points.shape == (65536, 2)
    assert points.min() >= 0
    assert points.max() < 1
    assert not np.any(points * 2.0**32 % 1)  # exact: no rounding moves a point out of its box


def test_first_point_is_near_the_middle():
    # A single light should stand near the median of the map's light, not at a pole.
    assert low_discrepancy_points(1)[0] == pytest.approx([0.5, 0.5], abs=0.03)


def test_points_differ():
    points = low_discrepancy_points(65536)
    assert len(np.unique(points[:, 0])) == len(np.unique(points[:, 1])) == 65536


@pytest.mark.parametrize("count", [64, 256, 1024])
def test_integrates_a_smooth_function_far_better_than_random(count):
    # ∫∫ sin(πx) sin(πy) = 4/π². The deviation of sin(πx) sin(πy) is √(1/4 − 16/π⁴) = 0.293, so
    # random points err by 0.293/√n; well-spread ones by about log(n)/n.
    points = low_discrepancy_points(count)
    error = np.sin(np.pi * points).prod(axis=1).mean() - 4 / np.pi**2
    assert abs(error) < 0.25 * 0.293 / np.sqrt(count)
