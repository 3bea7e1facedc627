"""Parts of one small source as one light again.

Many lights cut a lamp into parts, each with a shadow map or rays of its own, and too weak to be
drawn sharply. Seen from a scene they are one disc.

Input  : lights by direction, irradiance and angular radius.    Output : the same, or fewer.
Fails  : the shape of the source becomes a disc of the same second moment.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.lights.narrow_lights import PEAK_RAD

Array = NDArray[np.float64]

_MOST_CONTRAST = 4.0
"""Parts of one source are as bright as each other: a sun is not one with the sky around it."""


def gathered_parts(
    directions: Array, irradiance: Array, radius_rad: Array
) -> tuple[Array, Array, Array]:
    """Return lights in which neighbours of like radiance are one disc, if it is a narrow one.

    Parameters
    ----------
    directions, irradiance : (K, 3) float64
    radius_rad : (K,) float64
        Points, of radius 0, stay what they are.
    """
    power = irradiance @ LUMINANCE_WEIGHTS
    is_part = (radius_rad > 0) & (radius_rad <= PEAK_RAD) & (power > 0)
    candidates = np.flatnonzero(is_part)
    candidates = candidates[np.argsort(-power[candidates], kind="stable")]
    joins = _may_join(directions[candidates], power[candidates] / radius_rad[candidates] ** 2)
    is_left = np.ones(len(candidates), np.bool_)
    stay, discs = ~is_part, []
    for seed in np.flatnonzero(joins.sum(axis=1) > 1):
        parts = candidates[joins[seed] & is_left]
        if is_left[seed] and len(parts) > 1:
            disc = _disc(directions[parts], irradiance[parts], radius_rad[parts], power[parts])
            if disc[2] <= PEAK_RAD:
                is_left &= ~joins[seed]
                discs.append(disc)
    stay[candidates[is_left]] = True
    if not discs:
        return directions, irradiance, radius_rad
    gathered = (np.array(column) for column in zip(*discs, strict=True))
    kept = (directions[stay], irradiance[stay], radius_rad[stay])
    joined = [np.concatenate(each) for each in zip(kept, gathered, strict=True)]
    return joined[0], joined[1], joined[2]


def _may_join(directions: Array, radiance: Array) -> NDArray[np.bool_]:
    """Return which lights (K, K) are near each other and about as bright."""
    near = directions @ directions.T > np.cos(2 * PEAK_RAD)
    contrast = np.abs(np.subtract.outer(*[np.log(radiance)] * 2))
    return near & (contrast < np.log(_MOST_CONTRAST))


def _disc(
    directions: Array, irradiance: Array, radius_rad: Array, power: Array
) -> tuple[Array, Array, float]:
    """Return the disc of the same light, whose second moment is that of all parts together."""
    weight = power / power.sum()
    mean = weight @ directions
    mean /= np.linalg.norm(mean)
    off2 = np.sum((directions - mean) ** 2, axis=1)
    return mean, irradiance.sum(axis=0), float(np.sqrt(weight @ (radius_rad**2 + 2 * off2)))
