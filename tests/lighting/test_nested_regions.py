"""Regions between thresholds: a plain flood fill as the oracle, and the seam and poles by hand."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lighting.cells.nested_regions import nested_regions

THRESHOLDS = np.array([1.0, 2.0, 3.0])


def flood(mask, start):
    """Return the entries (rows, columns) of `mask` that hang together with `start`."""
    rows, columns = mask.shape
    found = np.zeros_like(mask)
    waiting = [start]
    while waiting:
        row, column = waiting.pop()
        if found[row, column] or not mask[row, column]:
            continue
        found[row, column] = True
        waiting += [(row, (column + 1) % columns), (row, (column - 1) % columns)]
        waiting += [(r, column) for r in (row - 1, row + 1) if 0 <= r < rows]
        if row in (0, rows - 1):
            waiting += [(row, c) for c in range(columns)]
    return found


@settings(deadline=None, max_examples=100)
@given(
    levels=st.tuples(st.integers(1, 6), st.integers(1, 9)).flatmap(
        lambda shape: arrays(np.float64, shape, elements=st.integers(0, 3).map(float))
    )
)
def test_agrees_with_a_flood_fill(levels):
    regions, parents = nested_regions(levels, THRESHOLDS)
    assert regions.min() >= 0
    assert regions.max() < len(parents)
    root = len(parents) - 1
    assert parents[root] == root
    np.testing.assert_array_equal(regions == root, levels == 0)
    for region in range(root):
        members = np.argwhere(regions == region)
        start = tuple(members[0])
        level = levels[start]
        component = flood(levels >= level, start)
        np.testing.assert_array_equal(regions == region, component & (levels == level))
        # The parent is what is next darker of the component at the next lower threshold at which
        # anything is added.
        parent = root
        for lower in range(int(level) - 1, 0, -1):
            added = flood(levels >= lower, start) & (levels == lower)
            if added.any():
                parent = regions[tuple(np.argwhere(added)[0])]
                break
        assert parents[region] == parent
        assert parent > region


def test_the_seam_parts_nothing_and_a_pole_joins_its_row():
    picture = np.zeros((6, 8))
    picture[3, [0, 7]] = 1.0  # both sides of the seam
    picture[0, [1, 5]] = 1.0  # both touch the pole
    picture[1, 1] = 1.0
    regions, parents = nested_regions(picture, THRESHOLDS)
    assert regions[3, 0] == regions[3, 7]
    assert regions[0, 1] == regions[0, 5] == regions[1, 1]
    assert len(parents) == 3


def test_corners_do_not_join():
    picture = np.zeros((6, 8))
    picture[2, 3] = picture[3, 4] = 1.0
    regions, _ = nested_regions(picture, THRESHOLDS)
    assert regions[2, 3] != regions[3, 4]


def test_equal_thresholds_make_one_region():
    # As those of a map without any deviation are.
    regions, parents = nested_regions(np.ones((4, 8)), np.zeros(5))
    assert (regions == 0).all()
    np.testing.assert_array_equal(parents, [1, 1])
