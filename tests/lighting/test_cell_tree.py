"""The tree of cells: the same leaves as without memory, and steady with one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.adaptive.cell_tree import EMPTY_TREE, CellTree, grow_tree, tree_sums
from lighting.blocks.summed_area import block_sums, summed_area_tables
from lighting.cells.cell_splitting import lights_of_sums
from lighting.methods.cells import cells_of_blocks
from lighting.sphere.latlong import cell_directions
from tests.environments import bright_poles, constant, environment, one_hot, outdoors, two_cells

MAPS = {
    "outdoors": outdoors(32),
    "constant": constant(),
    "bright poles": bright_poles(),
    "two cells": two_cells(),
    "one cell": one_hot(),
}
each_map = pytest.mark.parametrize("view", MAPS.values(), ids=MAPS)


LAMPS = np.array([[0.0, 0.8, 0.6], [0.8, -0.6, 0.0]])


def left_over(tree, view):
    """Return Σ S0² − |S1|² over the leaves: what cuts are for."""
    sums = tree_sums(block_sums(view.radiance), tree)[tree.leaves()]
    return (sums[:, 0] ** 2 - (sums[:, 1:4] ** 2).sum(axis=1)).sum()


def tables(view):
    return summed_area_tables(block_sums(view.radiance))


def noisy(view, noise, seed):
    factor = 1 + noise * np.random.default_rng(seed).standard_normal(view.radiance.shape)
    return environment(view.radiance * factor.clip(0))


def same(tree, other):
    return all(
        np.array_equal(getattr(tree, name), getattr(other, name))
        for name in ("rectangles", "cuts", "first_part")
    )


@each_map
@pytest.mark.parametrize("count", [1, 2, 7, 64, 300])
def test_leaves_are_the_cells_of_the_method_without_memory(view, count):
    blocks = block_sums(view.radiance)
    tree, was = grow_tree(*summed_area_tables(blocks), count)
    assert (was == -1).all()
    leaves = tree_sums(blocks, tree)[tree.leaves()]
    directions, irradiance, radius = lights_of_sums(leaves)
    expected = cells_of_blocks(blocks, count)
    order, other = (np.lexsort(np.round(d, 9).T) for d in (directions, expected[0]))
    # Each cell is one rectangle of blocks: equal sums tell that the rectangles are.
    np.testing.assert_allclose(directions[order], expected[0][other], atol=1e-9)
    np.testing.assert_allclose(irradiance[order], expected[1][other], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(radius[order], expected[2][other], atol=1e-6)


@each_map
def test_leaves_tile_the_map(view):
    tree, _ = grow_tree(*tables(view), 50)
    covered = np.zeros(view.radiance.shape[:2], int)
    for top, bottom, left, right in tree.rectangles[tree.leaves()]:
        covered[top:bottom, left:right] += 1
    assert (covered == 1).all()


@settings(deadline=None, max_examples=25)
@given(counts=st.tuples(st.integers(1, 120), st.integers(1, 120)))
def test_a_prefix_is_the_tree_of_fewer(counts):
    few, more = sorted(counts)
    moments, lit = tables(outdoors(16))
    whole, _ = grow_tree(moments, lit, more)
    assert same(whole.prefix(few), grow_tree(moments, lit, few)[0])


def test_a_prefix_of_none_is_empty():
    tree, _ = grow_tree(*tables(outdoors(16)), 9)
    assert same(tree.prefix(0), EMPTY_TREE)
    assert same(tree.prefix(9), tree)
    assert same(tree.prefix(99), tree)


@each_map
def test_the_memory_of_the_same_map_changes_nothing(view):
    moments, lit = tables(view)
    before, _ = grow_tree(moments, lit, 40)
    again, was = grow_tree(moments, lit, 40, before)
    assert {tuple(r) for r in again.rectangles} == {tuple(r) for r in before.rectangles}
    np.testing.assert_array_equal(before.rectangles[was], again.rectangles)


def test_noise_moves_no_cut():
    before, _ = grow_tree(*tables(outdoors(32)), 64)
    for seed in range(12):
        tree, was = grow_tree(*tables(noisy(outdoors(32), 0.03, seed)), 64, before)
        assert {tuple(r) for r in tree.rectangles} == {tuple(r) for r in before.rectangles}
        np.testing.assert_array_equal(before.rectangles[was], tree.rectangles)
        before = tree
    # Without memory it does, so this would notice a memory that does nothing.
    fresh, _ = grow_tree(*tables(noisy(outdoors(32), 0.03, 1)), 64)
    assert {tuple(r) for r in fresh.rectangles} != {tuple(r) for r in before.rectangles}


def test_cells_go_where_the_light_has_gone():
    # A soft lamp, and then another far from it: the cuts around the first are given up.
    up, aside = (np.exp(30 * (cell_directions(32) @ d - 1)) for d in LAMPS)
    before, _ = grow_tree(*tables(environment(0.01 + up)), 32)
    after, was = grow_tree(*tables(environment(0.01 + aside)), 32, before)
    fresh, _ = grow_tree(*tables(environment(0.01 + aside)), 32)
    assert (was < 0).sum() > 15
    left, least = (left_over(tree, environment(0.01 + aside)) for tree in (after, fresh))
    assert left < 1.5 * least < 0.5 * left_over(before, environment(0.01 + aside))


@pytest.mark.parametrize("height", [16, 15, 33])
def test_the_memory_of_another_grid_is_none(height):
    before, _ = grow_tree(*tables(outdoors(32)), 64)
    moments, lit = tables(outdoors(height))
    tree, was = grow_tree(moments, lit, 64, before)
    assert (was == -1).all()
    assert same(tree, grow_tree(moments, lit, 64)[0])


def test_sums_are_those_of_the_rectangles():
    blocks = block_sums(outdoors(32).radiance)
    tree, _ = grow_tree(*summed_area_tables(blocks), 30)
    plain = [blocks[t:b, left:right].sum(axis=(0, 1)) for t, b, left, right in tree.rectangles]
    np.testing.assert_allclose(tree_sums(blocks, tree), plain, rtol=1e-9, atol=1e-12)


def test_a_dark_map_is_one_leaf():
    tree, _ = grow_tree(*tables(environment(np.zeros((8, 16)))), 5)
    assert same(tree, CellTree(np.array([[0, 8, 0, 16]]), np.array([-1], np.int64), np.array([-1])))
