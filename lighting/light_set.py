"""The lights of one moment: distant, each with a direction, an irradiance and an extent."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.radiance import RELATIVE


@dataclass(frozen=True, eq=False)
class LightSet:
    """Distant lights that stand for an environment map.

    Attributes
    ----------
    directions : (K, 3) float64
        Unit vectors in the world frame, from the scene toward the light.
    irradiance : (K, 3) float64
        ∫ L dω over what the light stands for, linear Rec.709: the irradiance on a surface that
        faces it. Finite and at least 0.
    angular_radius_rad : (K,) float64
        Radius of what the light stands for, 0 for a point: of the cone with its solid angle where
        light is sampled, of the uniform disc with its spread where the map is cut into cells.
    timestamp_s : float
        Moment of the bracket the lights come from.
    clipped_fraction : float
        Share of the luminance that comes from clipped cells: above 0 the lights are a lower bound.
    scale : str
        Scale of the radiance ("relative" or a unit); irradiance is that × sr.
    source : str
        What the lights were made from and how, for people.

    A set without lights (K = 0) stands for a map without light.
    """

    directions: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    angular_radius_rad: NDArray[np.float64]
    timestamp_s: float = 0.0
    clipped_fraction: float = 0.0
    scale: str = RELATIVE
    source: str = ""

    def __post_init__(self) -> None:
        directions = read_only("directions", self.directions, np.float64, (None, 3))
        count = len(directions)
        irradiance = read_only("irradiance", self.irradiance, np.float64, (count, 3))
        radius = read_only("angular_radius_rad", self.angular_radius_rad, np.float64, (count,))
        if not np.allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-6):
            raise ValueError("directions must be unit vectors")
        if not np.all(np.isfinite(irradiance)) or np.any(irradiance < 0):
            raise ValueError("irradiance must be finite and at least 0")
        if np.any(~(radius >= 0)) or np.any(radius > np.pi):
            raise ValueError("angular_radius_rad must be in [0, π]")
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "irradiance", irradiance)
        object.__setattr__(self, "angular_radius_rad", radius)

    def __len__(self) -> int:
        return len(self.directions)
