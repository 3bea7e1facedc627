"""Statistics that tell whether a sampler has the density it claims.

A chi-square test compares counts with expectations; cells that expect too few are pooled. A z-test
compares a mean with the truth. Šidák's correction keeps the chance of a false alarm over a whole
family of tests at the level asked for.
"""

import math

import numpy as np
from numpy.typing import NDArray

LEAST_EXPECTED = 5.0


def chi_square_p_value(observed: NDArray[np.integer], expected: NDArray[np.floating]) -> float:
    """Return the probability of counts at least this far from `expected` if it is right.

    Zero at once where a cell that cannot be hit was hit, or the totals differ. Cells that expect
    fewer than 5 are pooled into one.

    Notes
    -----
    The tail of χ² is that of a normal variable after Wilson and Hilferty's cube root: within a few
    per cent of the tail for 10 and more degrees of freedom and p > 1e-6. With none, p is 1.
    """
    observed = np.asarray(observed, np.float64).ravel()
    expected = np.asarray(expected, np.float64).ravel()
    if observed[expected == 0].any():
        return 0.0
    if not math.isclose(observed.sum(), expected.sum(), rel_tol=1e-9):
        return 0.0
    small = expected < LEAST_EXPECTED
    observed = np.append(observed[~small], observed[small].sum())
    expected = np.append(expected[~small], expected[small].sum())
    if expected[-1] < LEAST_EXPECTED:  # even the pool is small: leave it out
        observed, expected = observed[:-1], expected[:-1]
    freedom = len(expected) - 1
    if freedom < 1:
        return 1.0
    statistic = float(((observed - expected) ** 2 / expected).sum())
    spread = 2 / (9 * freedom)
    z = ((statistic / freedom) ** (1 / 3) - (1 - spread)) / math.sqrt(spread)
    return 0.5 * math.erfc(z / math.sqrt(2))


def sidak(level: float, tests: int) -> float:
    """Return the level of each of `tests` independent tests that makes `level` for all of them."""
    return -math.expm1(math.log1p(-level) / tests)


def z_score(samples: NDArray[np.floating], truth: float) -> float:
    """Return by how many standard errors the mean of `samples` (n,) is above `truth`."""
    error = float(np.std(samples, ddof=1)) / math.sqrt(len(samples))
    return (float(np.mean(samples)) - truth) / error


def sphere_counts(
    directions: NDArray[np.floating], heights: int, azimuths: int
) -> NDArray[np.int64]:
    """Return how many directions (n, 3) fall in each of heights × azimuths equal cells.

    Cells divide cos θ from +1 to −1 and φ from π to −π evenly.
    """
    y = directions[:, 1]
    phi = np.arctan2(directions[:, 0], directions[:, 2])
    row = np.clip(((1 - y) / 2 * heights).astype(int), 0, heights - 1)
    column = np.clip(((np.pi - phi) / (2 * np.pi) * azimuths).astype(int), 0, azimuths - 1)
    counts = np.bincount(row * azimuths + column, minlength=heights * azimuths)
    return counts.reshape(heights, azimuths)


def sphere_shares(
    radiance: NDArray[np.floating], heights: int, azimuths: int
) -> NDArray[np.float64]:
    """Return the share of a lat-long map's light (N, 2N) in each cell of `sphere_counts`.

    Exact: both grids are products of intervals in cos θ and φ, so overlaps are products too.
    """
    rows, columns = radiance.shape
    row_overlap = _overlap(
        (1 - np.linspace(1, -1, heights + 1)) / 2, (1 - np.cos(np.linspace(0, np.pi, rows + 1))) / 2
    )
    column_overlap = _overlap(np.linspace(0, 1, azimuths + 1), np.linspace(0, 1, columns + 1))
    light = row_overlap @ radiance.astype(np.float64) @ column_overlap.T
    return light / light.sum()


def _overlap(coarse: NDArray[np.float64], fine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length of the overlap of each interval of one grid with each of another."""
    start = np.maximum(coarse[:-1, None], fine[None, :-1])
    end = np.minimum(coarse[1:, None], fine[None, 1:])
    return np.clip(end - start, 0, None)
