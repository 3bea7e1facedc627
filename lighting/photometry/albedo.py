"""The albedo of the ground that a map shows: what it sends up over what it receives.

An albedometer's measurement: irradiance on a level surface that faces down over that on one that
faces up. Both come from one map, so that no scale is needed.

Input  : an EnvironmentMap.    Output : a reflectance for each channel.
Fails  : where the lower half shows more than the ground: a tripod, furniture, walls down to the
         floor. Each counts by its cosine, so what is near the horizon hardly does. The shadow that
         camera or mirror ball cast counts as dark ground.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.photometry.illuminance import cosine_weights

LEAST_GROUND, _LEAST_SKY = 0.1, 0.5
"""Shares of either half, by the cosine, that have to be seen. Ground is much the same everywhere;
of the sky, what was not seen may be the sun."""


@dataclass(frozen=True, eq=False)
class GroundAlbedo:
    """What share of the light that falls on the ground it sends back.

    Attributes
    ----------
    reflectance : (3,) float64
        Of linear red, green and blue, at most 1.
    seen_share : float
        Share of the lower half, by the cosine, that the camera saw.
    """

    reflectance: NDArray[np.float64]
    seen_share: float


def ground_albedo(environment: EnvironmentMap) -> GroundAlbedo | None:
    """Return the ground's albedo; None where too little of the ground or of the sky was seen.

    What was not seen below counts as the mean of what was, what was not seen above as it is filled.
    """
    radiance, ground_share = ground_radiance(environment)
    up = cosine_weights(environment.height, (0.0, 1.0, 0.0))
    sky_share = float(up[environment.valid].sum() / up.sum())
    received = np.einsum("rc,rcx->x", up, environment.radiance)
    if ground_share < LEAST_GROUND or sky_share < _LEAST_SKY or not np.all(received > 0):
        return None
    return GroundAlbedo(np.minimum(np.pi * radiance / received, 1.0), ground_share)


def ground_radiance(environment: EnvironmentMap) -> tuple[NDArray[np.float64], float]:
    """Return the radiance (3,) of the ground that was seen, its mean by the cosine, and its share.

    A uniform ground of that radiance lights what faces it as much. 0 where nothing was seen.
    """
    theta = np.linspace(0.0, np.pi, environment.height + 1)
    weights = np.maximum(-np.diff(np.sin(theta) ** 2), 0.0) / (2 * environment.height)
    sums = _seen_sums(environment.radiance, environment.valid, weights)
    return (sums[:3] / sums[3] if sums[3] > 0 else np.zeros(3)), float(sums[3])


@njit(cache=True, nogil=True)
def _seen_sums(
    radiance: NDArray[np.float32], valid: NDArray[np.bool_], weights: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover - compiled
    """Return the sums of weighted red, green and blue of valid cells, and of their weights, (4,).

    Weights are those of a row's cells.
    """
    sums = np.zeros(4)
    for row in range(len(weights)):
        if weights[row] == 0:
            continue
        red = green = blue = 0.0
        count = 0
        for column in range(valid.shape[1]):
            if valid[row, column]:
                red += radiance[row, column, 0]
                green += radiance[row, column, 1]
                blue += radiance[row, column, 2]
                count += 1
        sums[0] += weights[row] * red
        sums[1] += weights[row] * green
        sums[2] += weights[row] * blue
        sums[3] += weights[row] * count
    return sums
