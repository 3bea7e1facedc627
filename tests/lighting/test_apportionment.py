"""Lights shared out among regions: laws, and values by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.cells.apportionment import apportion


def shared_out(weight, most, parents, count):
    return apportion(np.array(weight, float), np.array(most), np.array(parents), count)


@st.composite
def region_trees(draw):
    number = draw(st.integers(1, 12))
    parents = [draw(st.integers(region + 1, number - 1)) for region in range(number - 1)]
    most = draw(st.lists(st.integers(0, 9), min_size=number, max_size=number))
    powers = draw(st.lists(st.integers(-60, 60), min_size=number, max_size=number))
    weight = [1.3**power if room else 0.0 for power, room in zip(powers, most, strict=True)]
    return weight, most, [*parents, number - 1]


@settings(deadline=None, max_examples=100)
@given(tree=region_trees(), count=st.integers(1, 60))
def test_laws(tree, count):
    weight, most, parents = tree
    owners, seats = shared_out(weight, most, parents, count)
    assert seats.sum() == min(count, sum(most))
    root = len(parents) - 1
    room = np.bincount(owners, weights=most, minlength=root + 1)
    assert (seats <= room).all()
    np.testing.assert_array_equal(seats > 0, room > 0)
    np.testing.assert_array_equal(owners[owners], owners)
    for region, owner in enumerate(owners):
        while region != owner:  # the owner lies around the region
            assert region != root
            region = parents[region]


@settings(deadline=None, max_examples=50)
@given(tree=region_trees(), count=st.integers(1, 60), exponent=st.integers(-40, 40))
def test_brightness_changes_nothing(tree, count, exponent):
    weight, most, parents = tree
    plain = shared_out(weight, most, parents, count)
    scaled = shared_out(np.array(weight) * 2.0**exponent, most, parents, count)
    np.testing.assert_array_equal(scaled, plain)


def test_lights_are_as_the_weights():
    # 10 lights as 5 : 3 : 2, none of them too faint.
    owners, seats = shared_out([5, 3, 2], [99, 99, 99], [2, 2, 2], 10)
    np.testing.assert_array_equal(owners, [0, 1, 2])
    np.testing.assert_array_equal(seats, [5, 3, 2])


def test_a_full_region_leaves_its_lights_to_the_others():
    # A sun of 3 blocks has nearly all the weight; the other 7 lights are as 2 : 5.
    _, seats = shared_out([1e6, 2, 5], [3, 99, 99], [2, 2, 2], 10)
    np.testing.assert_array_equal(seats, [3, 2, 5])


def test_lights_round_as_the_weights_do():
    # 9 lights as 6.4 : 2.6. Dividing by lights + 1, as parliaments do, would make 7 and 2.
    _, seats = shared_out([6.4, 2.6], [99, 99], [1, 1], 9)
    np.testing.assert_array_equal(seats, [6, 3])


def test_what_is_faint_is_judged_by_the_lights_that_a_full_region_leaves():
    # 7 of 10 lights are left for a weight of 7, so 0.4 is worth less than half a light.
    owners, seats = shared_out([1e6, 0.4, 6.6], [3, 99, 99], [2, 2, 2], 10)
    np.testing.assert_array_equal(owners, [0, 2, 2])
    np.testing.assert_array_equal(seats, [3, 0, 7])


def test_a_region_worth_less_than_half_a_light_joins_the_one_around_it():
    # 10 lights for a weight of 100: region 0 is worth 0.4, region 1 0.6. The root gets the weight
    # of region 0 too, 40 of 100.
    owners, seats = shared_out([4, 6, 54, 36], [9, 9, 99, 99], [3, 3, 3, 3], 10)
    np.testing.assert_array_equal(owners, [3, 1, 2, 3])
    np.testing.assert_array_equal(seats, [0, 1, 5, 4])


def test_a_region_joins_the_nearest_that_is_left():
    # Region 0 lies in region 1, which is too faint itself, even with both; they end in the root.
    owners, seats = shared_out([1, 2, 97], [9, 9, 99], [1, 2, 2], 10)
    np.testing.assert_array_equal(owners, [2, 2, 2])
    np.testing.assert_array_equal(seats, [0, 0, 10])


def test_faint_regions_may_be_worth_a_light_together():
    owners, seats = shared_out([4, 4, 92], [9, 9, 99], [1, 2, 2], 10)
    np.testing.assert_array_equal(owners, [1, 1, 2])
    np.testing.assert_array_equal(seats, [0, 1, 9])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_more_regions_than_lights_give_up_the_faintest(count):
    owners, seats = shared_out([10, 11, 12, 13], [9, 9, 9, 9], [3, 3, 3, 3], count)
    assert seats.sum() == count
    np.testing.assert_array_equal(owners, [3] * (4 - count) + [1, 2, 3][3 - count :])


@settings(deadline=None, max_examples=50)
@given(weight=st.lists(st.floats(1.0, 1.4), min_size=2, max_size=8), count=st.integers(9, 100))
def test_one_light_more_is_taken_from_none(weight, count):
    # With regions as equal as these none is too faint for 9 lights, so they stay the same.
    root = len(weight) - 1
    tree = ([200] * len(weight), [root] * len(weight))
    _, fewer = shared_out(weight, *tree, count)
    _, more = shared_out(weight, *tree, count + 1)
    assert (more >= fewer).all()
