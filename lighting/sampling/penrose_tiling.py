"""A nested sequence of evenly spread points: golden triangles numbered in the Fibonacci system.

The plane is tiled by the halves of Penrose's rhombs, triangles of two kinds. At each level a large
triangle is cut in a large and a small one, and a small one becomes large as it stands; areas shrink
by the golden ratio φ. What part of what part a triangle is makes its digits: 0 the large one, 1 the
small one, whose next digit is 0. No two 1 meet, so these are the numerals of the Fibonacci system.
Read with the finest digit the most significant, the triangles of level n have the numbers
0 … F(n+2) − 1, each once. A triangle's point is where keeping its large part for ever ends, so the
triangle keeps number and point at all finer levels, and the points of numbers below any limit are
spread evenly.

Domain : complex plane, one large obtuse triangle.    Output : numbers and points, in a rectangle.
Cost   : in proportion to the triangles that reach into the rectangle.
Fails  : the distance to the nearest point is at least 0.52 and in the mean 0.73 times √(area per
         point), that of a hexagonal lattice 1.07. Ostromoukhov et al. [1]_ narrow the gap by moving
         points by tabulated corrections, found by relaxation; there are none here.

Notes
-----
Which of a triangle's equal corners comes first decides how its parts are cut. Where triangles match
as Penrose's do, the points of two mirrored halves of a rhomb coincide; of the sixteen rules that
give the same areas, the one here spreads points best.

References
----------
.. [1] V. Ostromoukhov, C. Donohue, P.-M. Jodoin, "Fast Hierarchical Importance Sampling with Blue
       Noise Properties", ACM Transactions on Graphics 23(3) (SIGGRAPH), 2004.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Numbers = NDArray[np.int64]
Points = NDArray[np.complex128]

_GOLDEN = (1 + math.sqrt(5)) / 2
_MOST_LEVELS = 88


def fibonacci_numbers(count: int) -> Numbers:
    """Return F(0) = 0, F(1) = 1, … F(count − 1), at most 92."""
    numbers = np.zeros(count, np.int64)
    numbers[1] = 1
    for i in range(2, count):
        numbers[i] = numbers[i - 1] + numbers[i - 2]
    return numbers


_FIBONACCI = fibonacci_numbers(_MOST_LEVELS + 3)


@njit(cache=True, nogil=True)
def points_below(root, limit, left, right, bottom, top):  # type: ignore[no-untyped-def]
    """Return the numbers below a limit whose points lie in a rectangle, and the points.

    Parameters
    ----------
    root : (3,) complex128
        Apex and ends of the base of a triangle with an angle of 108°.
    limit : float
        In the whole root lie as many points as there are natural numbers below it.
    left, right, bottom, top : float
        The rectangle, borders included.

    Returns
    -------
    numbers : (n,) int64
        In no order.
    points : (n,) complex128
    """
    numbers = [np.int64(0) for _ in range(0)]
    points = [0j for _ in range(0)]
    _add_points_below(root, limit, left, right, bottom, top, numbers, points)
    return np.array(numbers), np.array(points)


@njit(cache=True, nogil=True)
def points_in_rectangles(root, limits, rectangles):  # type: ignore[no-untyped-def]
    """Return what `points_below` does for each limit (m,) and rectangle (m, 4), in turn.

    Returns
    -------
    numbers : (n,) int64
    points : (n,) complex128
    owners : (n,) int64
        Index of the rectangle.
    """
    numbers = [np.int64(0) for _ in range(0)]
    points = [0j for _ in range(0)]
    owners = [0 for _ in range(0)]
    for k in range(len(limits)):
        left, right, bottom, top = rectangles[k]
        _add_points_below(root, limits[k], left, right, bottom, top, numbers, points)
        owners += [k] * (len(numbers) - len(owners))
    return np.array(numbers), np.array(points), np.array(owners)


@njit(cache=True, nogil=True)
def _add_points_below(root, limit, left, right, bottom, top, numbers, points):  # type: ignore[no-untyped-def]
    """Append to lists what `points_below` returns."""
    # What waits to be looked at is in arrays: a list of tuples takes four times as long.
    corners = np.empty((2 * _MOST_LEVELS, 3), np.complex128)
    places = np.empty((2 * _MOST_LEVELS, 2), np.int64)
    kinds = np.empty((2 * _MOST_LEVELS, 2), np.bool_)
    corners[0] = root
    places[0] = 0, 1
    kinds[0] = True
    waiting = 1
    while waiting > 0:
        waiting -= 1
        a, b, c = corners[waiting]
        number, level = places[waiting]
        is_obtuse, is_large = kinds[waiting]
        if (
            max(a.real, b.real, c.real) < left
            or min(a.real, b.real, c.real) > right
            or max(a.imag, b.imag, c.imag) < bottom
            or min(a.imag, b.imag, c.imag) > top
        ):
            continue
        # The next other number in the triangle is at least this much larger.
        first = level if is_large else level + 1
        if first > _MOST_LEVELS or number + _FIBONACCI[first + 1] >= limit:
            point = b + (c - b) / _GOLDEN**2 if is_obtuse else a + (c - a) / _GOLDEN
            if left <= point.real <= right and bottom <= point.imag <= top:
                numbers.append(number)
                points.append(point)
            continue
        places[waiting] = number, level + 1
        if not is_large:
            kinds[waiting] = is_obtuse, True
            waiting += 1
            continue
        places[waiting + 1] = number + _FIBONACCI[level + 1], level + 1
        kinds[waiting] = not is_obtuse, True
        kinds[waiting + 1] = is_obtuse, False
        if is_obtuse:
            cut = b + (c - b) / _GOLDEN
            corners[waiting, 0], corners[waiting, 1], corners[waiting, 2] = b, a, cut
            corners[waiting + 1, 0], corners[waiting + 1, 1], corners[waiting + 1, 2] = cut, a, c
        else:
            cut = a + (b - a) / _GOLDEN
            corners[waiting, 0], corners[waiting, 1], corners[waiting, 2] = cut, c, a
            corners[waiting + 1, 0], corners[waiting + 1, 1], corners[waiting + 1, 2] = c, b, cut
        waiting += 2
