"""Which exposures to take next: the fewest that hold the scene, judged by the bracket before.

Input  : the range of the last bracket and the times that the camera can do.
Output : ExposurePlan.
What changes when (`next_plan`): light that clips or darkness that sinks into noise changes the
exposures with the next bracket; exposures that are no longer needed go after PATIENCE brackets that
could all have done without. A plan has MARGIN_EV to spare at either end and is kept until that is
used up, so noise changes nothing.
Starts : with exposures over all that the camera can do, so that the second bracket is planned for
         the scene. From any other exposures the third is.
Fails  : light that flashes between two brackets is not seen. Only times are chosen, never a gain: a
         high gain can beat a longer exposure (Hasinoff, Durand and Freeman, "Noise-optimal capture
         for high dynamic range photography", CVPR 2010), but few cameras tell what theirs does.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.scene_range import UNKNOWN_RANGE, SceneRange
from capture.sensor import Sensor, clear_level

LEAST_SNR = 10.0
"""Signal to noise ratio that a pixel of the scene's darkest part is to have."""

MARGIN_EV = 0.5
"""How much brighter or darker than measured the scene may turn before it is planned anew; and by
how much the ranges of neighbouring exposures overlap."""

PATIENCE = 10
"""Brackets in a row that must do with fewer exposures before fewer are taken."""

_MARGIN = 2.0**MARGIN_EV
_ROUNDING = 1e-9
_STEPS_TRIED = 64


@dataclass(frozen=True)
class ExposurePlan:
    """The exposures of the next bracket.

    Attributes
    ----------
    times_s : tuple of float
        Rising.
    is_probe : bool
        They were chosen while an end of the scene's range was not known.
    spare_count : int
        Brackets in a row for which fewer would have done.
    """

    times_s: tuple[float, ...]
    is_probe: bool = True
    spare_count: int = 0


def possible_times(
    range_s: tuple[float, float], step_s: float, mains_hz: float = 0.0
) -> NDArray[np.float64]:
    """Return the exposure times to choose from, in seconds, rising.

    Parameters
    ----------
    range_s : (float, float)
        Shortest and longest time that the camera can do without losing frame rate.
    step_s : float
        Its times are the shortest plus a multiple of it.
    mains_hz : float
        Frequency of the mains that feed the scene's lamps, or 0. They pulse twice a period; from
        one pulse on, only whole numbers of pulses are possible, which see them steady. Shorter
        times cannot.
    """
    step_count = math.floor((range_s[1] - range_s[0]) / step_s + _ROUNDING)
    times_s = range_s[0] + step_s * np.arange(step_count + 1, dtype=np.float64)
    if not mains_hz:
        return times_s
    pulse_s = 0.5 / mains_hz
    # Within half a step of a whole number of pulses: the camera can come no nearer.
    off_s = np.abs(times_s - pulse_s * np.rint(times_s / pulse_s))
    is_whole = off_s <= step_s * (0.5 + _ROUNDING)
    is_short = times_s < pulse_s - step_s / 2
    possible = times_s[is_whole | is_short]
    return possible if possible.size else times_s[:1]


def usable_light(sensor: Sensor) -> tuple[float, float]:
    """Return the least and the most light, in seconds × radiance, that one exposure measures.

    The least has a signal to noise ratio of LEAST_SNR in every channel, the most is saturation;
    both hold for gain 1, which live cameras have.

    Raises
    ------
    InputError
        If they are less than a factor of 4 apart: no bracket is of use then.
    """
    least = clear_level(sensor, 1.0, LEAST_SNR)
    if 4.0 * least > sensor.saturation:
        raise InputError(
            f"the sensor ({sensor.source}) is too noisy to choose exposures for it; "
            "name them with --exposures"
        )
    return least, sensor.saturation


def plan_exposures(
    scene: SceneRange, light: tuple[float, float], possible_s: NDArray[np.float64]
) -> tuple[float, ...]:
    """Return the fewest exposure times that measure all of the scene, in seconds, rising.

    The shortest holds the brightest, the longest raises the darkest out of the noise, and whatever
    lies between is within `light` in one of them. The widest steps that this allows make them the
    fewest (an interval covered by intervals, from one end). So many are then spent on the least
    signal to noise ratio of all: steps are as even as the camera's times allow, and the longest
    gives the darkest as much light as the others give where they take over,
    (most / darkest)^(1 − 1/n) · shortest^(1/n) for n exposures.
    What the camera cannot do is left out at the ends: it clips, or stays in noise.

    Parameters
    ----------
    scene : SceneRange
    light : (float, float)
        What one exposure measures, from `usable_light`.
    possible_s : (n,) float64
        From `possible_times`.
    """
    least, most = light
    first_s = _quotient(most / _MARGIN, scene.brightest)
    last_s = _quotient(least * _MARGIN, scene.darkest)
    first = _last_at_most(possible_s, first_s)
    last = min(int(np.searchsorted(possible_s, last_s * (1 - _ROUNDING))), len(possible_s) - 1)
    if last <= first:
        return (float(possible_s[first]),)
    widest_step = most / (least * _MARGIN)
    fewest = len(_chain(possible_s, first, last, widest_step))
    # As much light in the darkest as where an exposure takes over from a clipped one.
    shortest_s = float(possible_s[first])
    balanced_s = _quotient(most, scene.darkest) ** (1 - 1 / fewest) * shortest_s ** (1 / fewest)
    for end in (max(_last_at_most(possible_s, balanced_s), last), last):
        even_step = (possible_s[end] / possible_s[first]) ** (1 / (fewest - 1))
        for step in np.geomspace(even_step, widest_step, _STEPS_TRIED):
            chain = _chain(possible_s, first, end, step)
            if len(chain) == fewest:
                return tuple(float(time_s) for time_s in possible_s[chain])
    raise AssertionError("the widest step makes the fewest exposures")


def _chain(possible_s: NDArray[np.float64], first: int, last: int, step: float) -> list[int]:
    """Return positions from `first` to `last`, each time at most `step` times the one before.

    Where the possible times lie farther apart than that, the next one is taken.
    """
    chain = [first]
    while chain[-1] < last:
        farthest = _last_at_most(possible_s, step * possible_s[chain[-1]])
        chain.append(min(max(farthest, chain[-1] + 1), last))
    return chain


def first_plan(light: tuple[float, float], possible_s: NDArray[np.float64]) -> ExposurePlan:
    """Return the plan for a scene of which nothing is known."""
    return ExposurePlan(plan_exposures(UNKNOWN_RANGE, light, possible_s))


def next_plan(
    plan: ExposurePlan,
    scene: SceneRange,
    light: tuple[float, float],
    possible_s: NDArray[np.float64],
) -> ExposurePlan:
    """Return the plan for the next bracket.

    Parameters
    ----------
    plan : ExposurePlan
        The one that the last bracket was taken by.
    scene : SceneRange
        What that bracket shows.
    light, possible_s
        As for `plan_exposures`.
    """
    fresh_s = plan_exposures(scene, light, possible_s)
    if plan.is_probe or not _serves(plan.times_s, scene, light, possible_s):
        return ExposurePlan(fresh_s, is_probe=not _is_known(plan.times_s, scene, possible_s))
    if len(fresh_s) >= len(plan.times_s):
        return replace(plan, spare_count=0)
    if plan.spare_count + 1 < PATIENCE:
        return replace(plan, spare_count=plan.spare_count + 1)
    return ExposurePlan(fresh_s, is_probe=False)


def _serves(
    times_s: tuple[float, ...],
    scene: SceneRange,
    light: tuple[float, float],
    possible_s: NDArray[np.float64],
) -> bool:
    """Whether the times are possible and measure the scene, or the camera can do no better."""
    least, most = light
    return (
        bool(np.isin(times_s, possible_s).all())
        and (times_s[0] == possible_s[0] or scene.brightest * times_s[0] <= most)
        and (times_s[-1] == possible_s[-1] or scene.darkest * times_s[-1] >= least)
    )


def _is_known(
    times_s: tuple[float, ...], scene: SceneRange, possible_s: NDArray[np.float64]
) -> bool:
    """Whether a bracket of these times tells all about the scene that this camera can find out."""
    return (scene.brightest < math.inf or times_s[0] == possible_s[0]) and (
        scene.darkest > 0.0 or times_s[-1] == possible_s[-1]
    )


def _last_at_most(possible_s: NDArray[np.float64], time_s: float) -> int:
    """Return the position of the longest time up to `time_s`, or of the shortest of all."""
    return max(int(np.searchsorted(possible_s, time_s * (1 + _ROUNDING), side="right")) - 1, 0)


def _quotient(light: float, radiance: float) -> float:
    return light / radiance if radiance > 0.0 else math.inf
