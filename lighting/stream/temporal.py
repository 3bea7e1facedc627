"""Lights that are steady from frame to frame: what trembles is smoothed, what changes is followed.

What is shown is a mixture of what was shown before and what came (mixing.py), in a share that is
the same for all light, fill included: so the sum of all light is that of what came, smoothed alike,
whatever becomes of single lights. The share adapts [1]_: what came deviates from what was shown,
and deviations that keep their direction are a change and followed; those that waver (noise, the
alias of mains ripple) are smoothed. Directions are never mixed across more than 10°: a light that
has no partner near it fades in or out where it stands.

Input  : the lights of each frame, by any method.    Output : lights, and what to remember.
Cost   : about 0.15 ms for 64 lights, 0.3 ms for 96 and a fill; a quarter of it checks of LightSet.
Latency: 1 − exp(−t/0.25 s) of any change is shown at least, nine tenths within 0.58 s; a change
         that has the scene to itself is shown in its own frame.
Fails  : light that truly wavers is taken for noise (tests/limits/test_temporal_wavering.py), and so
         are the first frames of a change that is small beside the noise, or comes within half a
         second of a larger one. After a large change, noise is followed for as long.

Unfiltered, and with this, One-Euro on the flux (1 Hz, slope 1) and a FIR over 0.2 s (Hann) through
the same matching; change of the error of irradiance behind occluders, in % per frame (error in %),
of 64 lights of `cells` on the sequences of sequences.py, maps of 32 rows, after 12 frames:

    hard sun over the seam   0.07 (0.4)   0.07 (0.4)   0.96 (2.1)   1.53 (2.7)
    one lamp for another     0.01 (0.2)   0.01 (0.2)   3.12 (25)    2.93 (21)
    cloud front              0.08 (0.7)   0.08 (0.7)   3.03 (9.8)   7.84 (15)
    still, 1 % noise         0.68 (0.9)   0.10 (0.7)   0.10 (0.7)   0.14 (0.8)
    small lamp, 3 % noise    0.89 (1.3)   0.35 (1.3)   0.34 (1.5)   0.56 (1.5)
    mains alias              21.4 (13)    1.47 (1.2)   4.08 (2.9)   0.02 (0.3)
    light switch             0.02 (0.6)   0.02 (0.6)   2.59 (6.6)   6.51 (17)
    passer-by                0.13 (0.9)   0.16 (0.9)   3.43 (8.6)   6.41 (15)

One-Euro and the FIR smooth what the methods get right; only against mains is a FIR better.

References
----------
.. [1] D. W. Trigg, A. G. Leach, "Exponential smoothing with an adaptive response rate",
       Operational Research Quarterly 18, 1967: the smoothed deviation over the smoothed size of
       deviations as the rate of smoothing.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import luminance
from lighting.sphere import harmonics
from lighting.stream.mixing import mixed

Array = NDArray[np.float64]

_SMOOTHING_S = 0.25
_RESPONSE_S = 0.12
"""Over which deviations are judged: shorter notices a change sooner, longer knows noise better."""
_WAVERS, _FOLLOWS = 0.5, 0.95
"""Ratio of deviation to swing up to which a change is noise, and from which on it is followed."""
_FIRST_SWING = 0.003
"""Swing to start with, relative to the light: a smaller first deviation is taken for noise."""
_FIRST_INTERVAL_S = 1 / 30


@dataclass(frozen=True, eq=False)
class Memory:
    """What the next frame has to know of those before.

    Attributes
    ----------
    lights : LightSet
        As shown last.
    interval_s : float
        Between the last two frames whose time advanced.
    deviation : (9,) float64
        Smoothed difference between the light that came and the light that was shown, as harmonics
        of its luminance.
    swing : float
        Smoothed size of that difference.
    odd_times : int
        Frames so far that were not later than the one before.
    """

    lights: LightSet
    interval_s: float
    deviation: Array
    swing: float
    odd_times: int = 0


def steady(lights: LightSet, memory: Memory | None = None) -> tuple[LightSet, Memory]:
    """Return the lights to show for this frame, and what to remember for the next.

    Parameters
    ----------
    lights : LightSet
        Of this frame. Its timestamp says how much time has passed; a frame that is not later than
        the one before counts as one more interval. Frames that were lost need not be given.
    memory : Memory or None
        From the last frame; None for the first, which is shown as it came.

    Returns
    -------
    lights : LightSet
        A light has the index it had in the last frame. Those that went out leave a light without
        irradiance until another takes the place. At most 32 (mixing.MOST_FADING) more than the most
        lights that came in any frame.
    memory : Memory
        For the next frame.

    Raises
    ------
    InputError
        If the radiance of this frame has another scale than that of the last.
    """
    if memory is None:
        swing = _FIRST_SWING * float(np.linalg.norm(_harmonics(lights)))
        return lights, Memory(lights, _FIRST_INTERVAL_S, np.zeros(harmonics.COUNT), swing)
    last = memory.lights
    if lights.scale != last.scale:
        raise InputError(f"lights in {lights.scale} cannot follow lights in {last.scale}")
    interval_s = lights.timestamp_s - last.timestamp_s
    is_odd = not interval_s > 0
    if is_odd:
        interval_s = memory.interval_s
    response = -np.expm1(-interval_s / _RESPONSE_S)
    deviation = _harmonics(lights) - _harmonics(last)
    smoothed = memory.deviation + response * (deviation - memory.deviation)
    swing = memory.swing + response * (float(np.linalg.norm(deviation)) - memory.swing)
    ratio = float(np.linalg.norm(smoothed)) / swing if swing else 0.0
    followed = np.clip((ratio - _WAVERS) / (_FOLLOWS - _WAVERS), 0.0, 1.0) ** 2
    least_share = -np.expm1(-interval_s / _SMOOTHING_S)
    share = float(least_share + (1 - least_share) * followed)
    if not lights.integral().any() or not last.integral().any():
        share = 1.0  # there is nothing to mix with
    (directions, irradiance, angular_radius_rad, is_key), left_over = mixed(last, lights, share)
    # Written so that a fill which stays the same does so to the last bit, and that what is left of
    # a bright one does not round a dim one below zero.
    fill = lights.fill + (1 - share) * (last.fill - lights.fill)
    fill[0] += left_over / np.sqrt(4 * np.pi)
    shown = replace(
        lights,
        directions=directions,
        irradiance=irradiance,
        angular_radius_rad=angular_radius_rad,
        is_key=is_key,
        fill=fill,
        clipped_fraction=_clipped_fraction(last, lights, share),
    )
    return shown, Memory(shown, interval_s, smoothed, swing, memory.odd_times + is_odd)


def _harmonics(lights: LightSet) -> Array:
    """Return the harmonics (9,) of the luminance of lights and fill."""
    from_lights = luminance(lights.irradiance) @ harmonics.basis(lights.directions)
    return from_lights + luminance(lights.fill)


def _clipped_fraction(last: LightSet, new: LightSet, share: float) -> float:
    """Return the share of the luminance of the mixture that comes from clipped cells."""
    last_flux = (1 - share) * float(luminance(last.integral()))
    new_flux = share * float(luminance(new.integral()))
    clipped = last_flux * last.clipped_fraction + new_flux * new.clipped_fraction
    return min(clipped / (last_flux + new_flux), 1.0) if clipped else 0.0
