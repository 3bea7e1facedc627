"""Which light of this frame is which of the last.

Input  : two sets of lights.    Output : for each light of the second, its number in the first.
Cost   : 15 to 30 µs for 64 lights against 64.
Fails  : a light that turns by more than 10° in a frame, or grows or shrinks to more than four times
         or less than a quarter, is another light.
"""

import numpy as np
from numba import njit

LARGEST_TURN_RAD = np.radians(10.0)
"""Two directions this far apart, mixed in any proportion, keep |Σ p d| / Σ p ≥ cos 5°: a light
between them is never far from where light is."""

_LARGEST_RATIO = 4.0


@njit(cache=True, nogil=True)
def stable_matching(directions, power, is_key, to_directions, to_power, to_is_key):  # type: ignore[no-untyped-def]
    """Return for each light its partner among `to_…`, (K,) int64, −1 where it has none.

    Parameters
    ----------
    directions, to_directions : (K, 3), (M, 3) float64
        Unit vectors.
    power, to_power : (K,), (M,) float64
        Luminance of the irradiance. Lights without any have no partner.
    is_key, to_is_key : (K,), (M,) bool
        Key lights match key lights only.

    Notes
    -----
    Partners are at most 10° apart, their powers within a factor of four. The distance of two lights
    is (chord/chord of 10°)² + (ln ratio/ln 4)², and the matching is stable: there are no two lights
    that are closer to each other than both are to their partners. Where all distances differ there
    is one such matching only, so the order of the lights does not matter.
    """
    count, to_count = len(power), len(to_power)
    distance = np.full((count, to_count), np.inf)
    largest_chord2 = 2 - 2 * np.cos(LARGEST_TURN_RAD)
    for i in range(count):
        if power[i] <= 0:
            continue
        for j in range(to_count):
            if to_power[j] <= 0 or is_key[i] != to_is_key[j]:
                continue
            chord2 = 0.0
            for k in range(3):
                chord2 += (directions[i, k] - to_directions[j, k]) ** 2
            if chord2 > largest_chord2:
                continue
            log_ratio = np.log(power[i] / to_power[j]) / np.log(_LARGEST_RATIO)
            if abs(log_ratio) <= 1:
                distance[i, j] = chord2 / largest_chord2 + log_ratio**2
    # Each light asks the closest that has no closer asker, until none asks any more.
    partner = np.full(count, -1)
    asker = np.full(to_count, -1)
    for first in range(count):
        i = first
        while i >= 0:
            best, best_distance = -1, np.inf
            for j in range(to_count):
                closer_to_another = asker[j] >= 0 and distance[asker[j], j] <= distance[i, j]
                if distance[i, j] < best_distance and not closer_to_another:
                    best, best_distance = j, distance[i, j]
            if best < 0:
                break
            left = asker[best]
            asker[best], partner[i] = i, best
            if left >= 0:
                partner[left] = -1
            i = left
    return partner
