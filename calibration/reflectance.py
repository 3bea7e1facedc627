"""How much of each channel's light a metal reflects, by the angle at which the light falls on it.

Domain : incidence angles from 0 (straight) to π/2 (grazing), unpolarised light.
Input  : the reflectance of light that falls straight on, for each channel.
Fresnel's equations for a conductor: M. Born, E. Wolf, "Principles of Optics", chapter 14. They take
a complex index n + ik, of which one measured reflectance gives the absorption k; the refraction n
is taken for 2, which lies between those of silver (0.1) and of iron or chrome (3).
Fails  : by what n really is: of silver, aluminium, nickel, iron, chrome by 2 % of the share up to
60° of incidence, 8 % at 75° and 12 % at 82° (Schlick's approximation: 7 %, 25 % and 33 %). And for
glass balls silvered inside, whose surface reflects a second time; for scratched and dusty ones.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.errors import InputError

Array = NDArray[np.float64]

_REFRACTION = 2.0
LEAST_REFLECTANCE = 0.2
"""Straight on; below (n − 1)² / (n + 1)², 0.11, no absorption goes with the refraction."""


def check_reflectance(reflectance: tuple[float, ...]) -> None:
    """Raise InputError unless it is three numbers that a metal can have."""
    if len(reflectance) != 3 or not all(LEAST_REFLECTANCE <= each < 1 for each in reflectance):
        raise InputError(
            f"reflectance is three numbers from {LEAST_REFLECTANCE} to below 1, of red, green and "
            f"blue light that falls straight on a metal; got {list(reflectance)}"
        )


def reflected_share(reflectance: ArrayLike, incidence_rad: ArrayLike) -> Array:
    """Return the share of each channel that is reflected, (..., 3), at incidence angles (...).

    `reflectance` (3,) is that of light that falls straight on.
    """
    straight = np.asarray(reflectance, np.float64)
    absorption = np.sqrt(
        (straight * (_REFRACTION + 1) ** 2 - (_REFRACTION - 1) ** 2) / (1 - straight)
    )
    squared = (_REFRACTION + 1j * absorption) ** 2
    angle = np.asarray(incidence_rad, np.float64)[..., None]
    cosine, inner = np.cos(angle), np.sqrt(squared - np.sin(angle) ** 2)
    across = np.abs((cosine - inner) / (cosine + inner)) ** 2
    along = np.abs((squared * cosine - inner) / (squared * cosine + inner)) ** 2
    return np.asarray((across + along) / 2)


def straight_reflectance(share: ArrayLike, incidence_rad: float) -> Array:
    """Return the reflectance (3,) straight on of a metal that reflects `share` (3,) at an angle.

    Raises
    ------
    InputError
        If no metal reflects as little or as much there.
    """
    wanted = np.asarray(share, np.float64)
    low, high = np.full(3, LEAST_REFLECTANCE), np.full(3, 1 - 1e-9)
    least, most = (reflected_share(each, incidence_rad) for each in (low, high))
    if not np.all((wanted >= least) & (wanted <= most)):
        raise InputError(
            f"the ball reflects {', '.join(f'{each:.3f}' for each in wanted)} of red, green and "
            f"blue; a metal reflects {least.max():.2f} to 1: is it the same thing in both places, "
            "matt, in the same light and not clipped?"
        )
    for _ in range(50):
        middle = (low + high) / 2
        too_dark = reflected_share(middle, incidence_rad) < wanted
        low, high = np.where(too_dark, middle, low), np.where(too_dark, high, middle)
    return (low + high) / 2
