"""Smooth light from everywhere: real spherical harmonics of order 2, nine numbers a channel.

Domain : world frame, unit directions d = (x, y, z). A function is (9, C): its coefficients of the
orthonormal real basis, index l(l + 1) + m, so that f(d) = Σ c Y(d):
Y = ½√(1/π) · [1, √3 y, √3 z, √3 x, √15 xy, √15 yz, ½√5 (3z² − 1), √15 xz, ½√15 (x² − y²)].
Fails  : nothing narrower than about 90° is in it; a projection of something brighter in one place
rings below zero elsewhere, which is what `windowed` is for.

References
----------
.. [1] R. Ramamoorthi, P. Hanrahan, "An Efficient Representation for Irradiance Environment Maps",
       SIGGRAPH, 2001: the irradiance from nine coefficients.
.. [2] P.-P. Sloan, "Stupid Spherical Harmonics (SH) Tricks", GDC, 2008: windowing by the least
       squared Laplacian, factors 1/(1 + λ l²(l + 1)²).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

COUNT = 9
"""Coefficients of a function of order 2."""

_DEGREE = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])
_COSINE_LOBE = np.array([np.pi, 2 * np.pi / 3, np.pi / 4])[_DEGREE]
_SQUARED_LAPLACIAN = (_DEGREE * (_DEGREE + 1.0)) ** 2
_BISECTIONS = 40  # halve an interval to 1e-12 of itself
_ROUNDING = 1e-12
_TINY = 1e-300


def basis(directions: NDArray[np.floating]) -> Array:
    """Return the nine basis functions (..., 9) at unit directions (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    first, second = np.sqrt(3 / (4 * np.pi)), np.sqrt(15 / (4 * np.pi))
    return np.stack(
        [
            np.full_like(x, np.sqrt(1 / (4 * np.pi))),
            first * y,
            first * z,
            first * x,
            second * x * y,
            second * y * z,
            second / np.sqrt(12) * (3 * z * z - 1),
            second * x * z,
            second / 2 * (x * x - y * y),
        ],
        axis=-1,
    )


def evaluate(coefficients: Array, directions: NDArray[np.floating]) -> Array:
    """Return the function's values (..., C) at unit directions (..., 3)."""
    return basis(directions) @ coefficients


def integral(coefficients: Array) -> Array:
    """Return ∫ f dω over the sphere, (C,)."""
    return np.sqrt(4 * np.pi) * coefficients[0]


def irradiance(coefficients: Array, normals: NDArray[np.floating]) -> Array:
    """Return ∫ f max(n·d, 0) dω (..., C) for unit normals (..., 3).

    Exact for a radiance of order 2: the even degrees above 2 of the cosine lobe meet nothing.
    """
    return basis(normals) @ (_COSINE_LOBE[:, None] * coefficients)


def lowest(coefficients: Array) -> Array:
    """Return the least value over the sphere of each channel, (C,), exact up to rounding."""
    return np.array([_least(*form, 1.0, 1.0) for form in _principal_forms(coefficients)])


def windowed(coefficients: Array) -> Array:
    """Return the function, smoothed as little as keeps every channel at 0 or above everywhere.

    All channels are smoothed alike, so that hues change together. The integral stays.

    Raises
    ------
    ValueError
        If the integral of a channel is negative: no window helps.
    """
    if np.any(coefficients[0] < 0):
        raise ValueError("a function of negative integral cannot be windowed to be positive")
    forms = _principal_forms(coefficients)
    strengths = [_window_strength(*form) for form in forms]
    return coefficients / (1 + max(strengths) * _SQUARED_LAPLACIAN)[:, None]


def _principal_forms(coefficients: Array) -> list[tuple[float, Array, Array]]:
    """Return k, b (3,) and λ (3,) of each channel's f(d) = k + b·d + Σ λ d² about its own axes.

    The axes are the eigenvectors of its quadratic part, which has no trace; λ ascends.
    """
    first, second = np.sqrt(3 / (4 * np.pi)), np.sqrt(15 / (4 * np.pi))
    coefficients = np.asarray(coefficients, np.float64)
    xy, yz, zz, xz, xx_yy = second / 2 * coefficients[4:]
    zz = zz / np.sqrt(3)
    quadratic = np.array([[xx_yy - zz, xy, xz], [xy, -xx_yy - zz, yz], [xz, yz, 2 * zz]])
    eigenvalues, axes = np.linalg.eigh(np.moveaxis(quadratic, -1, 0))
    linear = first * coefficients[[3, 1, 2]]
    along_axes = np.einsum("cij,ic->cj", axes, linear)
    return list(
        zip(coefficients[0] * np.sqrt(1 / (4 * np.pi)), along_axes, eigenvalues, strict=True)
    )


@njit(cache=True, nogil=True)
def _window_strength(constant, linear, eigenvalues):  # type: ignore[no-untyped-def]
    """Return the λ of the weakest window that leaves a form at 0 or above, to 1e-9 of itself."""
    floor = -_ROUNDING * constant
    if _least(constant, linear, eigenvalues, 1.0, 1.0) >= floor:
        return 0.0
    low, high = 1e-6, 1e12  # from no smoothing that shows to none but the mean
    for _ in range(_BISECTIONS):
        middle = np.sqrt(low * high)
        first, second = 1 / (1 + 4 * middle), 1 / (1 + 36 * middle)
        if _least(constant, linear, eigenvalues, first, second) >= floor:
            high = middle
        else:
            low = middle
    return high


@njit(cache=True, nogil=True)
def _least(constant, linear, eigenvalues, linear_factor, quadratic_factor):  # type: ignore[no-untyped-def]
    """Return the least value on |d| = 1 of a form whose parts are scaled.

    It is at d = −b / 2(λ − μ) for the one μ at most the least λ that gives |d| = 1: bisection finds
    s = λ₀ − μ between 0 and |b|/2. Where even s = 0 gives a shorter d, what it lacks lies along the
    axis of λ₀.
    """
    b = linear * linear_factor
    above = (eigenvalues - eigenvalues[0]) * quadratic_factor
    low, high = 0.0, np.sqrt((b * b).sum()) / 2
    for _ in range(_BISECTIONS):
        s = (low + high) / 2
        squared = 0.0
        for k in range(3):  # ten times as fast as with arrays
            squared += (b[k] / max(2 * (above[k] + s), _TINY)) ** 2
        if squared > 1:
            low = s
        else:
            high = s
    d = -b / np.maximum(2 * (above + high), _TINY)
    along = np.sqrt(max(1 - d[1] * d[1] - d[2] * d[2], 0.0))
    d[0] = along if d[0] >= 0 else -along
    d /= np.sqrt((d * d).sum())
    return constant + (b * d).sum() + quadratic_factor * (eigenvalues * d * d).sum()
