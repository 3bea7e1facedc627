"""How steadily lights follow a scene: what changes in the picture that did not in the world.

Input  : for each frame of a sequence, what surfaces receive from the lights and from the true map
         (error_measures.py), or the lights.    Output : one number for each pair of frames, or one.
Fails  : the motion of lights that come and go is not seen, only the change of light they make.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from lighting.light_set import LightSet
from lighting.maps.environment import luminance

Array = NDArray[np.float64]

_MATTERS = 0.01
"""Share of all light from which the motion of a light matters."""
_PASSED = 0.9


def excess_change(measured: Array, true: Array) -> Array:
    """Return how much more the light changes than it should from frame to frame, (T − 1,).

    Parameters
    ----------
    measured, true : (T, n, 3) float64
        Irradiance of n surfaces in T frames.

    Notes
    -----
    max(‖ΔE‖ − ‖ΔE_true‖, 0) / ‖E_true‖, with root mean squares over surfaces and channels, and the
    last over frames too. Light that changes as much as it should, but wrongly, is not seen: see
    `error_change`. 0 where all is dark.
    """
    excess = _size(np.diff(measured, axis=0)) - _size(np.diff(true, axis=0))
    return _relative(np.maximum(excess, 0.0), true)


def error_change(measured: Array, true: Array) -> Array:
    """Return ‖Δ(E − E_true)‖ / ‖E_true‖ from frame to frame, (T − 1,), as for `excess_change`.

    A light that follows late is charged for being late.
    """
    return _relative(_size(np.diff(measured - true, axis=0)), true)


def direction_motion(before: LightSet, after: LightSet) -> tuple[float, float]:
    """Return by what angle lights turn between two frames: in the mean, and at most.

    Each light of the smaller set is paired with one of the other, for the least sum of angles. The
    mean is weighted by the power that both of a pair have; the largest is of pairs that both have
    1 % of all light. In rad; 0 without lights.
    """
    if not len(before) or not len(after):
        return 0.0, 0.0
    chord = np.linalg.norm(before.directions[:, None] - after.directions, axis=-1)
    angle_rad = 2 * np.arcsin(np.minimum(chord / 2, 1.0))
    first, second = linear_sum_assignment(angle_rad)
    turns_rad = angle_rad[first, second]
    power, other = luminance(before.irradiance), luminance(after.irradiance)
    in_both = np.minimum(power[first], other[second])
    if not in_both.any():
        return 0.0, 0.0
    matters = in_both >= _MATTERS * max(power.sum(), other.sum())
    largest_rad = float(turns_rad[matters].max(initial=0.0))
    return float(np.average(turns_rad, weights=in_both)), largest_rad


def lag_of_step(timestamps_s: Sequence[float], light: Sequence[float], step: int) -> float:
    """Return how long after the step `light` stays within a tenth of the step of its last value.

    Parameters
    ----------
    timestamps_s, light : (T,) sequence of float
        Of each frame: its moment, and any measure of its light.
    step : int
        Frame of the step; the light of the frame before is where it starts.

    Returns
    -------
    float
        In s; 0 if the frame of the step has it all. Infinite if nothing stepped.
    """
    values = np.asarray(light, np.float64)
    distance = abs(values[step:] - values[-1])
    whole = abs(values[-1] - values[step - 1])
    if whole == 0:
        return np.inf
    late = np.flatnonzero(distance > (1 - _PASSED) * whole)
    first = step + late[-1] + 1 if len(late) else step
    return float(timestamps_s[first] - timestamps_s[step])


def _size(changes: Array) -> Array:
    return np.sqrt(np.mean(changes**2, axis=(1, 2)))


def _relative(changes: Array, true: Array) -> Array:
    size = float(np.sqrt(np.mean(true**2)))
    return changes / size if size else np.zeros_like(changes)
