"""Multiple importance sampling against each of its techniques alone, where each of them fails.

A glossy plane mirrors a spherical source: few directions of a rough surface's lobe meet a small
source, and few of those to a large source lie in a smooth surface's lobe. A matt floor beside an
area light that stands on it: near its foot, directions drawn by its area have densities without
bound, and far from it, few of the cosine's meet it.

Domain : one point of a surface, no occluders.
Output : the root mean square error of an estimate from `SAMPLES` directions over its mean.
Cost   : two seconds.

References
----------
.. [1] E. Veach, L. Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering",
       SIGGRAPH, 1995.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.claims.contract import Claim, Finding, Maps
from render.reference.reflection import drawn, reflected
from render.reference.surfaces import ALPHA2, F90, FIELDS, HIT, NORMAL, TO_EYE

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

SAMPLES = 2
"""Directions of an estimate: both of one technique, or one of each."""
ROUGHNESS = (0.1, 0.3, 0.6)
RADII_DEG = (0.5, 3.0, 15.0, 60.0)
DISTANCES = (0.02, 0.1, 0.5, 2.0)
"""From the foot of the area light, in its heights."""

NEAR = 1.5
"""An estimate has at most this many times the error of the best technique where it does well."""

_OVER_BEST = "error of the better heuristic over the better technique"
_DRAWN = 1 << 15
_HALF_WIDTH = 1.0  # of the area light, in its heights
_EYE_RAD = math.radians(45)


class Drawn(NamedTuple):
    """Directions that a technique drew.

    Attributes
    ----------
    value : (n,) float64
        Of the integrand.
    density, other : (n,) float64
        Of the technique itself and of the one it is combined with, per sr.
    """

    value: Array
    density: Array
    other: Array


def single(technique: Drawn) -> tuple[float, float]:
    """Return mean and variance of one estimate from one direction."""
    each = _over(technique.value, technique.density)
    return float(each.mean()), float(each.var())


def combined(first: Drawn, second: Drawn, power: float) -> tuple[float, float]:
    """Return mean and variance of an estimate from a direction of each, by the power heuristic.

    1 is the balance heuristic.
    """
    mean = variance = 0.0
    for technique in (first, second):
        own, other = technique.density**power, technique.other**power
        each = _over(technique.value, technique.density) * _over(own, own + other)
        mean += float(each.mean())
        variance += float(each.var())
    return mean, variance


def errors_of(light: Drawn, surface: Drawn) -> dict[str, float]:
    """Return the relative error of `SAMPLES` directions, by either technique and by both."""
    mean, by_balance = combined(light, surface, 1.0)
    variance = {
        "light": single(light)[1] / SAMPLES,
        "surface": single(surface)[1] / SAMPLES,
        "balance": by_balance,
        "power": combined(light, surface, 2.0)[1],
    }
    return {name: math.sqrt(each) / mean for name, each in variance.items()}


def glossy_under_sphere(roughness: float, radius_rad: float, seed: int = 0) -> tuple[Drawn, Drawn]:
    """Return directions to a source of radiance 1 that a surface mirrors, and of the lobe."""
    surface = np.zeros((FIELDS, 1), np.float32)
    surface[NORMAL + 1] = surface[F90] = surface[HIT] = 1.0
    surface[TO_EYE, 0], surface[TO_EYE + 1, 0] = -math.sin(_EYE_RAD), math.cos(_EYE_RAD)
    surface[ALPHA2] = roughness**4
    u, v = np.random.default_rng(seed).random((2, 2, _DRAWN))

    narrowest = 2 * math.sin(0.5 * radius_rad) ** 2  # 1 − cos of the radius
    lowered = narrowest * u[0]
    level = np.sqrt(lowered * (2 - lowered))
    turn = 2 * np.pi * v[0]
    centre = np.array([math.sin(_EYE_RAD), math.cos(_EYE_RAD), 0.0])
    across = np.array([math.cos(_EYE_RAD), -math.sin(_EYE_RAD), 0.0])
    toward = (
        (1 - lowered)[:, None] * centre
        + (level * np.cos(turn))[:, None] * across
        + (level * np.sin(turn))[:, None] * [0.0, 0.0, 1.0]
    )
    of_lobe = _drawn(surface, u[1], v[1])
    density = 1 / (2 * np.pi * narrowest)

    def looked_at(directions: Array) -> tuple[Array, Array, Array]:
        meets = directions @ centre >= 1 - narrowest
        above = directions[:, 1] > 0
        mirror, lobe = _reflected(surface, directions)
        return np.where(meets & above, mirror, 0.0), np.where(meets, density, 0.0), lobe

    value, of_light, lobe = looked_at(toward)
    from_light = Drawn(value, of_light, lobe)
    value, of_light, lobe = looked_at(of_lobe)
    return from_light, Drawn(value, lobe, of_light)


def floor_beside_light(distance: float, seed: int = 0) -> tuple[Drawn, Drawn]:
    """Return directions to points of an upright light of height 1, and by the floor's cosine.

    The point of the floor is `distance` from the light's foot, whose radiance is 1.
    """
    u, v = np.random.default_rng(seed).random((2, 2, _DRAWN))
    area = 2 * _HALF_WIDTH
    x, y = area * u[0] - _HALF_WIDTH, v[0]
    squared = x * x + y * y + distance * distance
    up, facing = y / np.sqrt(squared), distance / np.sqrt(squared)
    from_light = Drawn(up / np.pi, squared / (facing * area), up / np.pi)

    level, turn = np.sqrt(u[1]), 2 * np.pi * v[1]
    up = np.sqrt(1 - u[1])
    facing, across = level * np.cos(turn), level * np.sin(turn)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = distance / facing
        meets = (facing > 0) & (np.abs(along * across) <= _HALF_WIDTH) & (along * up <= 1)
        of_light = np.where(meets, along * along / (facing * area), 0.0)
    return from_light, Drawn(np.where(meets, up / np.pi, 0.0), up / np.pi, of_light)


def _against_single(settings: dict[str, tuple[Drawn, Drawn]]) -> list[Finding]:
    findings = []
    worst = dict.fromkeys(("light", "surface", "balance", "power"), 0.0)
    for setting, techniques in settings.items():
        errors = errors_of(*techniques)
        best = min(errors["light"], errors["surface"])
        for name, error in errors.items():
            worst[name] = max(worst[name], error)
        figures = {f"error by {name}": error for name, error in errors.items()}
        figures[_OVER_BEST] = min(errors["balance"], errors["power"]) / best
        holds = figures[_OVER_BEST] <= NEAR
        findings.append(Finding(setting, figures, holds))
    figures = {f"largest error by {name}": error for name, error in worst.items()}
    holds = min(worst["balance"], worst["power"]) < min(worst["light"], worst["surface"])
    findings.append(Finding("all of them", figures, holds))
    return findings


def _glossy(_maps: Maps) -> list[Finding]:
    return _against_single(
        {
            f"roughness {roughness:g}, source of radius {radius:g}°": glossy_under_sphere(
                roughness, math.radians(radius)
            )
            for roughness in ROUGHNESS
            for radius in RADII_DEG
        }
    )


def _beside(_maps: Maps) -> list[Finding]:
    return _against_single(
        {f"{distance:g} heights away": floor_beside_light(distance) for distance in DISTANCES}
    )


def _over(above: Array, below: Array) -> Array:
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


@njit(cache=True, nogil=True)
def _drawn(surface: Floats, u: Array, v: Array) -> Array:  # pragma: no cover - compiled
    """Return directions (n, 3) of the lobe of a surface (FIELDS, 1)."""
    directions = np.empty((len(u), 3))
    for k in range(len(u)):
        directions[k, 0], directions[k, 1], directions[k, 2] = drawn(surface, 0, u[k], v[k])
    return directions


@njit(cache=True, nogil=True)
def _reflected(
    surface: Floats, directions: Array
) -> tuple[Array, Array]:  # pragma: no cover - compiled
    """Return the mirror reflection × n·l without Fresnel's factor, and the lobe's density."""
    mirror, density = np.zeros(len(directions)), np.zeros(len(directions))
    for k in range(len(directions)):
        x, y, z = directions[k]
        if y > 0:
            mirror[k], _, density[k] = reflected(surface, 0, x, y, z)
    return mirror, density


_TEST = (
    f"Relative error of {SAMPLES} directions, both of one technique or one of each. Holds in a "
    f"setting where the better heuristic errs at most {NEAR:g} times as much as the better "
    "technique; of all settings together, where its largest error is below that of either one."
)
GLOSSY = Claim(
    "MIS on a glossy surface under a spherical source",
    "Each technique alone fails at some roughness and size of source; combined, they are near the "
    "better one everywhere.",
    "Veach, Guibas, SIGGRAPH 1995",
    _TEST,
    _glossy,
    _OVER_BEST,
)
BESIDE = Claim(
    "MIS on a floor beside an area light",
    "Drawn by area, directions fail near the light, and drawn by the cosine far from it; combined, "
    "they are near the better one everywhere.",
    "Veach, Guibas, SIGGRAPH 1995",
    _TEST,
    _beside,
    _OVER_BEST,
)
