"""What samples pass on of the light of cells and of narrow lights, once it is traced."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.baked.transport_kernel import add_transported

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Transport:
    """What samples pass on of the light of each cell, as `trace_transport` fills it.

    The scales, (tiles, 3, TILE), are the radiance of a step under a unit of light.
    """

    matt: NDArray[np.uint8]
    matt_scale: NDArray[np.float32]
    mirroring: NDArray[np.intp]
    mirror: NDArray[np.uint8]
    mirror_scale: NDArray[np.float32]

    def add(self, light: Array, mirrored: Array, picture: NDArray[np.float32]) -> None:
        """Add the radiance under ∫L dω of each cell to `picture` (tiles, 3, TILE).

        `light`, (D, 3), is what reaches matt surfaces, `mirrored` what the others show.
        """
        add_transported(self.matt, self.matt_scale, light.astype(np.float32), picture)
        if len(self.mirroring) and mirrored.any():
            shown = np.zeros((len(self.mirroring), *picture.shape[1:]), np.float32)
            add_transported(self.mirror, self.mirror_scale, mirrored.astype(np.float32), shown)
            picture[self.mirroring] += shown
