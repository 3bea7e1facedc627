"""Lights and maps of several cameras blended, by where they stand around a scene [1]_.

Input  : places, light sets in one world frame and one scale.    Output : weights, one LightSet.
Cost   : about 0.15 ms for two sets of 64 lights.
Fails  : lights are distant. A lamp between two cameras is seen by them in two directions; up to 10°
         apart (matching.py) it is one light of the blend, further apart two that share its power.
         A pair that comes within 10° joins from one frame to the next. Two cameras' "relative"
         radiance is of one scale only if they are alike, or were calibrated against each other.

References
----------
.. [1] T. Nikodym, V. Havran, J. Bittner, "Multiple Live Video Environment Map Sampling", WSCG 2013:
       the lights of several cameras in a room, interpolated.
.. [2] D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data",
       Proceedings of the 23rd ACM National Conference, 1968: weights by inverse distance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere import harmonics
from lighting.stream.matching import stable_matching

Array = NDArray[np.float64]

FADE_S = 1.0
"""How long a source takes to fade in or out of a blend."""


def place_weights(places_m: ArrayLike, at_m: ArrayLike) -> Array:
    """Return how much each place counts at a point, (N,), 1 in all.

    Inverse squares of the distances [2]_: at a place itself it alone counts.

    Parameters
    ----------
    places_m : (N, 3)
        Where the sources stand, N ≥ 1.
    at_m : (3,)
    """
    apart2 = ((np.asarray(places_m, np.float64) - np.asarray(at_m, np.float64)) ** 2).sum(axis=1)
    nearest2 = apart2.min()
    # The quotient is 1 where both are 0.
    counts = np.divide(nearest2, apart2, out=np.ones_like(apart2), where=apart2 > nearest2)
    return counts / counts.sum()


def followed_weights(shown: Array, wanted: Array, elapsed_s: float) -> Array:
    """Return the weights to show next: on the straight way to those wanted, 1 in all like both.

    Parameters
    ----------
    shown, wanted : (N,) float64
        At least 0, 1 in all.
    elapsed_s : float
        Since `shown`. No weight changes by more than `elapsed_s / FADE_S`.
    """
    most = np.abs(wanted - shown).max()
    step = elapsed_s / FADE_S
    return wanted if most <= step else shown + step / most * (wanted - shown)


def blend_lights(
    sets: Sequence[LightSet], weights: ArrayLike, *, timestamp_s: float, source: str
) -> LightSet:
    """Return the lights of all sets, each dimmed by its weight; what is one light to both is one.

    The sums of light, fills included, are the weighted ones of the sets. Which lights are one does
    not depend on the weights, so that nothing jumps while they change.

    Parameters
    ----------
    sets : sequence of LightSet
    weights : (N,)
        At least 0, 1 in all, one for each set. Sets without weight are left out.
    timestamp_s : float
        Moment of the blend.
    source : str
        What is blended, for people.

    Raises
    ------
    InputError
        If sets of different scales have weight.
    """
    parts = [
        (_lit(part, weight), weight)
        for part, weight in zip(sets, np.asarray(weights, np.float64).tolist(), strict=True)
        if weight > 0
    ]
    scale = parts[0][0].scale
    for part, _ in parts:
        if part.scale != scale:
            raise InputError(
                f"lights in {scale} ({parts[0][0].source}) cannot be blended with lights in "
                f"{part.scale} ({part.source}); calibrate both cameras or none"
            )
    group = _groups([part for part, _ in parts])
    dimmed = np.concatenate([weight * part.irradiance for part, weight in parts])
    power = luminance(dimmed)
    irradiance = _sums(dimmed, group)
    shares = power / _sums(power[:, None], group)[group, 0]
    directions = _sums(
        shares[:, None] * np.concatenate([part.directions for part, _ in parts]), group
    )
    radii = np.concatenate([part.angular_radius_rad for part, _ in parts])
    is_key = np.zeros(len(irradiance), np.bool_)
    is_key[group] = np.concatenate([part.is_key for part, _ in parts])
    errors = [part.predicted_error for part, _ in parts if part.predicted_error is not None]
    return LightSet(
        directions / np.linalg.norm(directions, axis=1, keepdims=True),
        irradiance,
        _sums((shares * radii)[:, None], group)[:, 0],
        timestamp_s=timestamp_s,
        clipped_fraction=_clipped_fraction(parts),
        scale=scale,
        source=source,
        is_key=is_key,
        fill=sum((weight * part.fill for part, weight in parts), np.zeros((harmonics.COUNT, 3))),
        predicted_error=max(errors) if len(errors) == len(parts) else None,
    )


def blend_maps(maps: Sequence[EnvironmentMap], weights: ArrayLike) -> EnvironmentMap:
    """Return the weighted sum of maps of one size: what one does not see is dark in its part.

    So it is in the lights. A cell is valid if a map with weight saw it, clipped if one was.
    """
    parts = [
        (part, np.float32(weight))
        for part, weight in zip(maps, np.asarray(weights, np.float64), strict=True)
        if weight > 0
    ]
    if len(parts) == 1:
        return parts[0][0]
    radiance = np.zeros_like(parts[0][0].radiance)
    valid = np.zeros_like(parts[0][0].valid)
    clipped = np.zeros_like(valid)
    for part, weight in parts:
        radiance += np.where(part.valid[..., None], weight * part.radiance, np.float32(0))
        valid |= part.valid
        clipped |= part.clipped
    return EnvironmentMap(radiance, valid, clipped, parts[0][0].scale)


def _lit(part: LightSet, weight: float) -> LightSet:
    """Return the set without the lights of which its weight leaves nothing."""
    lit = weight * luminance(part.irradiance) > 0
    if lit.all():
        return part
    return replace(
        part,
        directions=part.directions[lit],
        irradiance=part.irradiance[lit],
        angular_radius_rad=part.angular_radius_rad[lit],
        is_key=part.is_key[lit],
    )


def _groups(sets: Sequence[LightSet]) -> NDArray[np.int64]:
    """Return which light of the blend each light of the sets, one after the other, is part of.

    A light without a partner among those before it begins a group, and stands for it.
    """
    directions, power, is_key = np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.bool_)
    groups = []
    for part in sets:
        part_power = luminance(part.irradiance)
        group = stable_matching(part.directions, part_power, part.is_key, directions, power, is_key)
        is_first = group < 0
        group[is_first] = len(power) + np.arange(np.count_nonzero(is_first))
        groups.append(group)
        directions = np.concatenate([directions, part.directions[is_first]])
        power = np.concatenate([power, part_power[is_first]])
        is_key = np.concatenate([is_key, part.is_key[is_first]])
    return np.concatenate(groups)


def _sums(values: Array, group: NDArray[np.int64]) -> Array:
    """Return the sum of the rows (K, n) of each group."""
    sums = np.zeros((int(group.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(sums, group, values)
    return sums


def _clipped_fraction(parts: Sequence[tuple[LightSet, float]]) -> float:
    """Return the share of the blend's luminance that comes from clipped cells."""
    flux = [weight * float(luminance(part.integral())) for part, weight in parts]
    clipped = sum(each * part.clipped_fraction for each, (part, _) in zip(flux, parts, strict=True))
    return min(clipped / sum(flux), 1.0) if clipped else 0.0
