"""Light over the blocks of a lat-long grid, whatever picture it came from.

Blocks are the cells of a coarse grid of the sphere (CONVENTIONS.md, section 3). How much light each
has, from where and of which colour, is all that the cell methods need.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.radiance import RELATIVE
from lighting.maps.environment import LUMINANCE_WEIGHTS


@dataclass(frozen=True, eq=False)
class BlockSums:
    """Integrals of linear Rec.709 radiance over blocks of a lat-long grid.

    Attributes
    ----------
    sums : (rows, 2 rows, 7) float64
        Per block ∫Y dω, ∫Y d dω (3) and ∫L dω (3), Y the luminance of the radiance L, d the unit
        direction in the world frame.
    unseen_sr : (rows, 2 rows) float64
        Solid angle that was not seen, at least 0; it holds what it was filled with. Of a pixel that
        is not valid all is counted in one block, which may have less.
    clipped : (rows, 2 rows) float64
        The part of ∫Y dω that comes from clipped pixels, and is a lower bound.
    scale : str
        "relative", or the unit after an absolute calibration.
    """

    sums: NDArray[np.float64]
    unseen_sr: NDArray[np.float64]
    clipped: NDArray[np.float64]
    scale: str = RELATIVE

    def __post_init__(self) -> None:
        sums = read_only("sums", self.sums, np.float64, (None, None, 7))
        rows, columns = sums.shape[:2]
        if columns != 2 * rows or rows < 2:
            raise ValueError(f"sums over blocks must be (N, 2N, 7), got {sums.shape}")
        object.__setattr__(self, "sums", sums)
        for name in ("unseen_sr", "clipped"):
            plane = read_only(name, getattr(self, name), np.float64, (rows, columns))
            object.__setattr__(self, name, plane)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.sums.shape[0]

    def integral(self) -> NDArray[np.float64]:
        """∫ L dω over the sphere, per channel, (3,)."""
        return self.sums.sum(axis=0).sum(axis=0)[4:]  # ten times as fast as both axes at once

    @property
    def clipped_fraction(self) -> float:
        """Share of the luminance that comes from clipped pixels."""
        clipped = float(self.clipped.sum())
        return min(clipped / float(self.integral() @ LUMINANCE_WEIGHTS), 1.0) if clipped else 0.0
