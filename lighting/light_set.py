"""The lights of one moment: distant, each with a direction, an irradiance and an extent.

What is too smooth to need a light may stand beside them as a fill: radiance from everywhere, in
spherical harmonics of order 2.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.radiance import RELATIVE
from lighting.sphere import harmonics

_ROUNDING = 1e-9
_DEGREES = (slice(0, 1), slice(1, 4), slice(4, 9))


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
    is_key : (K,) bool
        True for a concentrated source, such as the sun or a lamp, that is a light of its own; the
        others stand for parts of the map. Without it none is.
    fill : (9, 3) float64
        Radiance that comes from everywhere beside the lights, harmonics of order 2
        (harmonics.py), nowhere negative. Without it there is none.
    predicted_error : float or None
        Relative error of irradiance behind occluders that these lights are expected to make, as
        prediction.py measures it; None where nobody asked.
    block_rows : int or None
        Rows of the grid that the map was reduced to before the lights were found.

    A set without lights (K = 0) and without fill stands for a map without light.
    """

    directions: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    angular_radius_rad: NDArray[np.float64]
    timestamp_s: float = 0.0
    clipped_fraction: float = 0.0
    scale: str = RELATIVE
    source: str = ""
    is_key: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    fill: NDArray[np.float64] = field(default_factory=lambda: np.zeros((harmonics.COUNT, 3)))
    predicted_error: float | None = None
    block_rows: int | None = None

    def __post_init__(self) -> None:
        directions = read_only("directions", self.directions, np.float64, (None, 3))
        count = len(directions)
        irradiance = read_only("irradiance", self.irradiance, np.float64, (count, 3))
        radius = read_only("angular_radius_rad", self.angular_radius_rad, np.float64, (count,))
        key = self.is_key if len(self.is_key) else np.zeros(count, np.bool_)
        is_key = read_only("is_key", key, np.bool_, (count,))
        fill = read_only("fill", self.fill, np.float64, (harmonics.COUNT, 3))
        if not np.allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-6):
            raise ValueError("directions must be unit vectors")
        if not np.all(np.isfinite(irradiance)) or np.any(irradiance < 0):
            raise ValueError("irradiance must be finite and at least 0")
        if np.any(~(radius >= 0)) or np.any(radius > np.pi):
            raise ValueError("angular_radius_rad must be in [0, π]")
        if not np.all(np.isfinite(fill)):
            raise ValueError("fill must be finite")
        if fill.any() and np.any(harmonics.lowest(fill) < -_ROUNDING * np.abs(fill).max()):
            raise ValueError("fill must be at least 0 in every direction; harmonics.windowed() is")
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "irradiance", irradiance)
        object.__setattr__(self, "angular_radius_rad", radius)
        object.__setattr__(self, "is_key", is_key)
        object.__setattr__(self, "fill", fill)

    def __len__(self) -> int:
        return len(self.directions)

    @property
    def fill_order(self) -> int | None:
        """Highest degree that the fill has, 0 to 2; None without a fill."""
        degrees = [d for d, rows in enumerate(_DEGREES) if np.any(self.fill[rows])]
        return max(degrees, default=None)

    @property
    def shadow_map_px(self) -> NDArray[np.int64]:
        """Side of the shadow map that each light is worth, (K,): a power of 2, 64 to 2048.

        Across a scene of radius R, the penumbra of an occluder R away is 2 R tan a wide, and a map
        of 2 R across with 4/tan a texels a side gives it four. A point asks for the most.
        """
        texels = 4 / np.tan(np.clip(self.angular_radius_rad, 1e-3, np.pi / 4))
        return 2 ** np.ceil(np.log2(np.clip(texels, 64, 2048))).astype(np.int64)

    def integral(self) -> NDArray[np.float64]:
        """Return ∫ L dω of lights and fill together, (3,)."""
        return self.irradiance.sum(axis=0) + harmonics.integral(self.fill)
