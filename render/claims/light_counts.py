"""Claims about how many lights are worth how many others, where they stand for a map.

Input  : maps.    Output : errors of the irradiance of surfaces behind occluders.
Cost   : fifteen seconds for each map of 256 rows.
"""

import math
from collections.abc import Sequence

import numpy as np

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.measures.error_measures import (
    Receivers,
    behind_occluders,
    errors,
    received,
    received_from_map,
    truth,
)
from lighting.methods.inverse_cdf import lights_of_points
from lighting.reduce import reduce_to_lights
from render.claims.contract import Claim, Finding, Maps, over

FEW, MANY = 300, 3000
CELL_COUNTS = (32, 64, 128, 256)

_FEW_OVER_MANY = f"error of {FEW} structured over {MANY} random"
_OVER_LLOYD = "error, Kollig-Keller over Lloyd"
_DRAWS = 32
_CHANCE = 2.0  # standard errors
_AZIMUTHS, _ELEVATIONS = 8, 48


def _structured_against_plain(maps: Maps) -> list[Finding]:
    findings = []
    for name, environment in maps.items():
        true = truth(environment)

        def error_of(lights: LightSet, true: dict[str, np.ndarray] = true) -> float:
            return behind_occluders(errors(lights, true, as_points=True))

        structured = error_of(reduce_to_lights(environment, FEW, "structured"))
        few, many = (
            _mean_square([error_of(_random(environment, count, seed)) for seed in range(_DRAWS)])
            for count in (FEW, MANY)
        )
        figures = {
            f"error of {FEW} structured": structured,
            f"error of {FEW} random": math.sqrt(few[0]),
            f"error of {MANY} random": math.sqrt(many[0]),
            _FEW_OVER_MANY: over(structured, math.sqrt(many[0])),
        }
        holds = (
            None if abs(structured**2 - many[0]) < _CHANCE * many[1] else structured**2 < many[0]
        )
        findings.append(Finding(name, figures, holds))
    return findings


def _kollig_keller_against_lloyd(maps: Maps) -> list[Finding]:
    findings = []
    for name, environment in maps.items():
        boundaries = shadow_boundaries()
        true = received_from_map(boundaries, environment)
        for count in CELL_COUNTS:
            figures = {}
            for label, method in (("Kollig-Keller", "kollig-keller"), ("Lloyd", "lloyd")):
                lights = reduce_to_lights(environment, count, method)
                seen = received(boundaries, lights, as_points=True)
                figures[f"error, {label}"] = boundary_error(seen, true)
                figures[f"largest step, {label}"] = largest_step(seen)
            figures[_OVER_LLOYD] = over(figures["error, Kollig-Keller"], figures["error, Lloyd"])
            holds = figures[_OVER_LLOYD] < 1
            findings.append(Finding(f"{name}, {count} lights", figures, holds))
    return findings


def shadow_boundaries() -> Receivers:
    """Return points of a level floor, from under a wall's foot to where it hides nothing.

    Seen from a point, the wall hides what is below a plane through its upper edge: planes at
    `_ELEVATIONS` angles, for walls along `_AZIMUTHS` directions, azimuth by azimuth.
    """
    azimuth = np.pi * (np.arange(_AZIMUTHS)[:, None] + 0.5) / _AZIMUTHS
    angle = np.pi * np.arange(1, _ELEVATIONS + 1) / (_ELEVATIONS + 1)
    level = -np.sin(angle)
    free = np.stack(
        [level * np.sin(azimuth), np.cos(angle) + 0 * azimuth, level * np.cos(azimuth)], axis=-1
    ).reshape(-1, 1, 1, 3)
    return Receivers(np.tile([0.0, 1.0, 0.0], (len(free), 1)), free)


def boundary_error(seen: np.ndarray, true: np.ndarray) -> float:
    """Return the root mean square error across all boundaries over the mean irradiance there."""
    return float(np.sqrt(np.mean((seen - true) ** 2)) / np.mean(true))


def largest_step(seen: np.ndarray) -> float:
    """Return the mean over walls of the largest step of light from one point to the next.

    Relative to what the whole boundary spans: the edge of a shadow that the eye sees.
    """
    across = seen.reshape(_AZIMUTHS, _ELEVATIONS, 3).mean(axis=-1)
    span = np.maximum(np.ptp(across, axis=1), np.finfo(float).tiny)
    return float(np.mean(np.abs(np.diff(across, axis=1)).max(axis=1) / span))


def _mean_square(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean of the squares and its standard error."""
    squares = np.square(values)
    return float(squares.mean()), float(squares.std(ddof=1)) / math.sqrt(len(squares))


def _random(environment: EnvironmentMap, count: int, seed: int) -> LightSet:
    points = np.random.default_rng([seed, count]).random((count, 2))
    return LightSet(*lights_of_points(environment, points))


STRUCTURED = Claim(
    "structured against plain sampling",
    f"{FEW} samples placed by structured importance sampling are worth {MANY:,} drawn at random.",
    "Agarwal, Ramamoorthi, Belongie, Jensen, SIGGRAPH 2003",
    f"Irradiance of 192 surfaces behind walls, spheres and combs, lights as points. Holds where "
    f"{FEW} structured lights err no more than {MANY:,} drawn by luminance × solid angle "
    f"(root mean square of {_DRAWS} draws); nothing is said where they differ by less than "
    f"{_CHANCE:g} standard errors of it.",
    _structured_against_plain,
    _FEW_OVER_MANY,
)
KOLLIG_KELLER = Claim(
    "Kollig-Keller against Lloyd",
    "Cells that grow where the power is have truer shadow boundaries than relaxed ones, at every "
    "number of lights from 32 to 256.",
    "Kollig, Keller, Eurographics Symposium on Rendering 2003",
    f"Irradiance of a floor across the shadow boundaries of {_AZIMUTHS} walls, lights as points. "
    "Holds where its error is smaller.",
    _kollig_keller_against_lloyd,
    _OVER_LLOYD,
)
