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
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.photometry.illuminance import cosine_weights

_LEAST_SEEN = {"ground": 0.1, "sky": 0.5}
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
    down = cosine_weights(environment.height, (0.0, -1.0, 0.0))
    up = cosine_weights(environment.height, (0.0, 1.0, 0.0))
    ground_share, sky_share = (float(w[environment.valid].sum() / w.sum()) for w in (down, up))
    if ground_share < _LEAST_SEEN["ground"] or sky_share < _LEAST_SEEN["sky"]:
        return None
    seen = np.where(environment.valid, down, 0.0)
    sent = np.einsum("rc,rcx->x", seen, environment.radiance) / ground_share
    received = np.einsum("rc,rcx->x", up, environment.radiance)
    if not np.all(received > 0):
        return None
    return GroundAlbedo(np.minimum(sent / received, 1.0), ground_share)
