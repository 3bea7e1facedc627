"""The illuminance that an environment map implies, on a surface of any direction and on a sphere.

Input  : an EnvironmentMap.    Output : lux if the map is in cd/m², else in its own relative unit.
A cell counts with ∫ d dω over it, exactly, so that a constant sky of luminance L gives πL on
surfaces along the axes of the world. Elsewhere the cells that the surface's plane cuts are counted
by their means: an error of order 1/N².
Fails  : where the map holds a lower bound (`clipped`) or a guess (not `valid`). How much of each is
told with every number.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere.latlong import solid_angles

FACINGS = {
    "up": (0.0, 1.0, 0.0),
    "down": (0.0, -1.0, 0.0),
    "+X": (1.0, 0.0, 0.0),
    "-X": (-1.0, 0.0, 0.0),
    "+Z": (0.0, 0.0, 1.0),
    "-Z": (0.0, 0.0, -1.0),
}
"""Surfaces of which the report tells: horizontal ones, and vertical ones to the four sides."""


@dataclass(frozen=True)
class Illuminance:
    """What a surface receives.

    Attributes
    ----------
    total : float
        In lx if the map is in cd/m².
    clipped_share : float
        Share of `total` from clipped cells. Where it is not 0, `total` is a lower bound.
    unseen_share : float
        Share of what the surface faces, by the cosine, that the camera did not see. Its light is
        what the map was filled with.
    """

    total: float
    clipped_share: float
    unseen_share: float


def surface_illuminance(environment: EnvironmentMap, normal: ArrayLike) -> Illuminance:
    """Return what a surface receives, ∫ L max(n·d, 0) dω, n its normal (3,) in the world frame.

    Raises
    ------
    InputError
        If the normal has no direction.
    """
    return _received(environment, cosine_weights(environment.height, normal))


def sphere_illuminance(environment: EnvironmentMap) -> Illuminance:
    """Return the mean over the surface of a small sphere, ∫ L dω / 4."""
    weights = np.repeat(solid_angles(environment.height)[:, None] / 4, 2 * environment.height, 1)
    return _received(environment, weights)


def cosine_weights(height: int, normal: ArrayLike) -> NDArray[np.float64]:
    """Return ∫ n·d dω of each cell that a surface with this normal faces, else 0: (N, 2N), in sr.

    They sum to π for normals along the axes of the world, if N is even.
    """
    return np.maximum(_cell_vectors(height) @ unit(normal), 0.0)


def unit(direction: ArrayLike) -> NDArray[np.float64]:
    """Return a direction (3,) of unit length; InputError if it has none."""
    vector = np.asarray(direction, np.float64)
    length = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not np.isfinite(length) or length < 1e-9:
        raise InputError(f"a direction is three numbers that are not all 0, got {vector.tolist()}")
    return vector / length


def _cell_vectors(height: int) -> NDArray[np.float64]:
    """Return ∫ d dω over each cell, (N, 2N, 3), in sr."""
    theta = np.linspace(0.0, np.pi, height + 1)
    phi = np.pi - np.linspace(0.0, 2 * np.pi, 2 * height + 1)
    across = np.diff(theta / 2 - np.sin(2 * theta) / 4)[:, None]  # ∫ sin² θ dθ
    along = np.diff(np.sin(theta) ** 2 / 2)[:, None]  # ∫ sin θ cos θ dθ
    return np.stack(
        [
            across * np.diff(np.cos(phi)),
            along * np.full(2 * height, np.pi / height),
            across * -np.diff(np.sin(phi)),
        ],
        axis=-1,
    )


def _received(environment: EnvironmentMap, weights: NDArray[np.float64]) -> Illuminance:
    light = luminance(environment.radiance) * weights
    total = float(light.sum())
    return Illuminance(
        total,
        float(light[environment.clipped].sum()) / total if total > 0 else 0.0,
        float(weights[~environment.valid].sum() / weights.sum()),
    )
