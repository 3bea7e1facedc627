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
    """Return lights in which neighbours of like radiance are one narrow disc, or several.

    Each disc is made up of as many lights around a strong one as `PEAK_RAD` holds: what glows
    around a low sun becomes a few discs strong enough to be drawn sharply.

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
        if not is_left[seed]:
            continue
        parts = np.flatnonzero(joins[seed] & is_left)
        cosine = directions[candidates[parts]] @ directions[candidates[seed]]
        parts = parts[np.argsort(-cosine, kind="stable")]
        taken = candidates[parts]
        disc, count = _disc(directions[taken], irradiance[taken], radius_rad[taken], power[taken])
        if count > 1:
            is_left[parts[:count]] = False
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
) -> tuple[tuple[Array, Array, float], int]:
    """Return the disc of the first parts that make up one narrow enough, and their number.

    Its light is theirs, and its second moment that of all of them together.
    """
    total = np.cumsum(power)
    sums = np.cumsum(power[:, None] * directions, axis=0)
    length = np.linalg.norm(sums, axis=1)
    # About the mean direction m, Σ p |d - m|² = 2 Σ p - 2 |Σ p d|.
    squared = (np.cumsum(power * radius_rad**2) + 4 * (total - length)) / total
    too_wide = squared > PEAK_RAD**2
    count = int(np.argmax(too_wide)) if too_wide.any() else len(power)
    last = max(count, 1) - 1
    disc = (
        sums[last] / length[last],
        irradiance[: last + 1].sum(axis=0),
        float(squared[last] ** 0.5),
    )
    return disc, count
