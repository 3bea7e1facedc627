"""The environment map: radiance over all directions, of a world that is far away."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.radiance import RELATIVE, check_radiance
from lighting.sphere.latlong import solid_angles

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear Rec.709 red, green and blue (ITU-R BT.709-6, item 3.2)."""


@dataclass(frozen=True, eq=False)
class EnvironmentMap:
    """Linear Rec.709 radiance on the lat-long grid (CONVENTIONS.md).

    Attributes
    ----------
    radiance : (N, 2N, 3) float32
        Finite and at least 0. Cells that were not seen hold what they were filled with.
    valid : (N, 2N) bool
        True where the camera saw the cell.
    clipped : (N, 2N) bool
        True where a clipped pixel contributed: the radiance is a lower bound.
    scale : str
        "relative", or the unit after an absolute calibration.
    """

    radiance: NDArray[np.float32]
    valid: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    scale: str = RELATIVE

    def __post_init__(self) -> None:
        radiance = read_only("radiance", self.radiance, np.float32, (None, None, 3))
        height, width = radiance.shape[:2]
        if width != 2 * height or height < 2:
            raise ValueError(f"an environment map must be (N, 2N, 3), got {radiance.shape}")
        check_radiance(radiance)
        object.__setattr__(self, "radiance", radiance)
        for name in ("valid", "clipped"):
            mask = read_only(name, getattr(self, name), np.bool_, (height, width))
            object.__setattr__(self, name, mask)

    @property
    def height(self) -> int:
        """Number of rows, N."""
        return self.radiance.shape[0]

    @property
    def seen_share(self) -> float:
        """Share of all directions that the camera saw, by solid angle."""
        return float(solid_angles(self.height) @ self.valid.sum(axis=1)) / (4 * np.pi)

    def integral(self) -> NDArray[np.float64]:
        """∫ L dω over the sphere, per channel, (3,)."""
        rows = self.radiance.sum(axis=1, dtype=np.float64)
        return solid_angles(self.height) @ rows


def luminance(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Luminance (...) of linear Rec.709 radiance (..., 3), in the unit of the radiance."""
    return np.asarray(radiance, np.float64) @ LUMINANCE_WEIGHTS
