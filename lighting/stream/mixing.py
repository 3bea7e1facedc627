"""Two sets of lights mixed into one, in which a light stays where it was in the first.

Input  : the lights shown last, and new ones.    Output : a share of each, as lights.
Cost   : about 30 µs for 64 lights and 64, half of it in matching.py.
Fails  : where no new light has any power, all others go out in one frame, shadows and all.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.stream.matching import stable_matching

Array = NDArray[np.float64]
Lights = tuple[Array, Array, Array, NDArray[np.bool_]]

MOST_FADING = 32
"""Lights that fade beside the new ones, at most."""

_FAINT = 0.1
"""Share of a mean new light's power below which a fading light goes out."""


def mixed(last: LightSet, new: LightSet, share: float) -> tuple[Lights, Array]:
    """Return 1 − share of the last lights and `share` of the new ones.

    Parameters
    ----------
    last : LightSet
        Keep their places. A light without irradiance is a free place.
    new : LightSet
        Those that match one of the last (matching.py) take its place, the others free places, and
        the end when there are none.
    share : float
        0 to 1.

    Returns
    -------
    lights : tuple of arrays
        Directions (K, 3), irradiance (K, 3), angular radii (K,), and whether key lights (K,), as in
        LightSet. With what is left over, the irradiances sum to 1 − share of the last sum and
        `share` of the new one.
    left_over : (3,) float64
        Irradiance of lights that went out without a new light to take it.

    Notes
    -----
    A light with a match turns toward it. What is mixed are the moments ∫ Y d dω, and so each
    direction by its share of the power; but the share is larger if the turn is larger in radii of
    the light, up to 1 where the light has left the place it had. Lights without a match dim where
    they are. The faint ones, and the faintest of more than `MOST_FADING`, go out: what they have
    left passes to the nearest new light. Where no new light has any power, all go out.
    """
    *lights, left_over = _mixed(*_arrays(last), *_arrays(new), share)
    directions, irradiance, angular_radius_rad, is_key = lights
    return (directions, irradiance, angular_radius_rad, is_key), left_over


def _arrays(lights: LightSet) -> Lights:
    return lights.directions, lights.irradiance, lights.angular_radius_rad, lights.is_key


@njit(cache=True, nogil=True)
def _mixed(  # type: ignore[no-untyped-def]
    last_directions,
    last_irradiance,
    last_radius_rad,
    last_is_key,
    directions,
    irradiance,
    radius_rad,
    is_key,
    share,
):
    last_power, power = _luminance(last_irradiance), _luminance(irradiance)
    place = stable_matching(directions, power, is_key, last_directions, last_power, last_is_key)
    goes_out = _going_out(last_power, share, place, power)

    is_new = place < 0
    end, free = len(last_power), 0
    for j in range(len(power)):
        if is_new[j] and power[j] > 0:
            while free < len(last_power) and last_power[free] > 0 and not goes_out[free]:
                free += 1
            place[j] = free
            free += 1
            end = max(end, free)

    mixed_directions, mixed_irradiance = np.zeros((end, 3)), np.zeros((end, 3))
    mixed_radius_rad, mixed_is_key = np.zeros(end), np.zeros(end, np.bool_)
    for i in range(len(last_power)):
        mixed_directions[i] = last_directions[i]
        mixed_radius_rad[i], mixed_is_key[i] = last_radius_rad[i], last_is_key[i]
        if not goes_out[i]:
            mixed_irradiance[i] = (1 - share) * last_irradiance[i]
    for j in range(len(power)):
        i = place[j]
        if i < 0:
            continue
        if is_new[j]:
            mixed_directions[i], mixed_irradiance[i] = directions[j], share * irradiance[j]
            mixed_radius_rad[i], mixed_is_key[i] = radius_rad[j], is_key[j]
            continue
        # Written so that light which stays the same does so to the last bit.
        mixed_irradiance[i] = last_irradiance[i] + share * (irradiance[j] - last_irradiance[i])
        mixed_radius_rad[i] = _turn(
            mixed_directions[i],
            last_radius_rad[i],
            last_power[i],
            directions[j],
            radius_rad[j],
            power[j],
            share,
        )
    left_over = np.zeros(3)
    for gone in range(len(last_power)):
        if not goes_out[gone]:
            continue
        heir = _nearest_lit(last_directions[gone], directions, power)
        if heir >= 0:
            mixed_irradiance[place[heir]] += (1 - share) * last_irradiance[gone]
        else:
            left_over += (1 - share) * last_irradiance[gone]
    while end > 0 and not mixed_irradiance[end - 1].any():
        end -= 1
    return (
        mixed_directions[:end],
        mixed_irradiance[:end],
        mixed_radius_rad[:end],
        mixed_is_key[:end],
        left_over,
    )


@njit(cache=True, nogil=True)
def _turn(direction, radius_rad, power, to_direction, to_radius_rad, to_power, share):  # type: ignore[no-untyped-def]
    """Turn `direction`, in place, part of the way to that of its match; return its new radius."""
    chord = to_direction - direction
    turn_rad = np.sqrt((chord * chord).sum())
    reach_rad = max(radius_rad, to_radius_rad, SUN_RADIUS_RAD)
    part = min(max(share, turn_rad / reach_rad), 1.0)
    if turn_rad > 0:
        arriving = part * to_power
        direction += arriving / ((1 - part) * power + arriving) * chord
        direction /= np.sqrt((direction * direction).sum())
    return radius_rad + part * (to_radius_rad - radius_rad)


@njit(cache=True, nogil=True)
def _going_out(last_power, share, place, power):  # type: ignore[no-untyped-def]
    """Return which of the last lights go out, (M,) bool."""
    goes_out = np.zeros(len(last_power), np.bool_)
    is_fading = last_power > 0
    for i in place:
        if i >= 0:
            is_fading[i] = False
    lit = np.count_nonzero(power)
    faint = _FAINT * power.sum() / lit if lit else np.inf
    for i in range(len(last_power)):
        if is_fading[i]:
            stronger = 0
            for j in range(len(last_power)):
                is_before = last_power[j] == last_power[i] and j < i
                stronger += is_fading[j] and (last_power[j] > last_power[i] or is_before)
            goes_out[i] = stronger >= MOST_FADING or (1 - share) * last_power[i] < faint
    return goes_out


@njit(cache=True, nogil=True)
def _nearest_lit(direction, directions, power):  # type: ignore[no-untyped-def]
    nearest, largest_cosine = -1, -np.inf
    for j in range(len(power)):
        cosine = (direction * directions[j]).sum()
        if power[j] > 0 and cosine > largest_cosine:
            nearest, largest_cosine = j, cosine
    return nearest


@njit(cache=True, nogil=True)
def _luminance(irradiance):  # type: ignore[no-untyped-def]
    power = np.empty(len(irradiance))
    for i in range(len(irradiance)):
        power[i] = (irradiance[i] * LUMINANCE_WEIGHTS).sum()
    return power
