"""In which order a picture's rows are worked on, so that threads have as much to do as each other.

Loops are dealt out in runs, one for each thread, and what is costly in a picture lies together: its
lower half shows the objects, its upper one the sky.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_GOLDEN = (math.sqrt(5) - 1) / 2


@njit(cache=True, nogil=True)
def row_order(first: int, stop: int) -> NDArray[np.int64]:  # pragma: no cover - compiled
    """Return the rows from `first` to before `stop` so that every run is spread over all of them.

    They are a golden section apart, or a step near it that comes by every row.
    """
    count = stop - first
    step = max(int(_GOLDEN * count), 1)
    while math.gcd(step, count) > 1:
        step += 1
    order = np.empty(count, np.int64)
    for k in range(count):
        order[k] = first + k * step % count
    return order
