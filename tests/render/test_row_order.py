"""Every row once, and every run of them spread over all."""

import numpy as np
import pytest

from render.rays.row_order import row_order


@pytest.mark.parametrize("count", [1, 2, 3, 7, 30, 64, 120, 480])
def test_every_row_comes_once(count: int) -> None:
    assert np.array_equal(np.sort(row_order(5, 5 + count)), np.arange(5, 5 + count))


def test_no_rows_give_none() -> None:
    assert len(row_order(3, 3)) == 0


@pytest.mark.parametrize("count", [30, 64, 120, 480])
@pytest.mark.parametrize("threads", [2, 3, 4, 8])
def test_every_thread_gets_its_share_of_any_part_of_the_picture(count: int, threads: int) -> None:
    order = row_order(0, count)
    for first, stop in ((0, count // 2), (count // 2, count), (count // 3, 2 * count // 3)):
        shares = [
            np.count_nonzero((run >= first) & (run < stop))
            for run in np.array_split(order, threads)
        ]
        assert max(shares) - min(shares) <= 3
