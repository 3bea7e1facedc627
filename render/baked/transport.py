"""What samples pass on of the light of cells and of narrow lights, once it is traced."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.baked.transport_kernel import add_narrow, add_transported
from render.lights.narrow_lights import NARROW_LIGHTS

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Transport:
    """What samples pass on of the light of each cell, as `trace_transport` fills it.

    The scales, (tiles, 3, TILE), are the radiance of a step under a unit of light.
    """

    matt: NDArray[np.uint8]
    matt_scale: _FLOATS
    mirroring: NDArray[np.intp]
    mirror: NDArray[np.uint8]
    mirror_scale: _FLOATS

    def add(self, light: Array, mirrored: Array, picture: _FLOATS) -> None:
        """Add the radiance under ∫L dω of each cell to `picture` (tiles, 3, TILE).

        `light`, (D, 3), is what reaches matt surfaces, `mirrored` what the others show.
        """
        tiles = np.arange(len(self.matt))
        add_transported(self.matt, self.matt_scale, *_shining(light), tiles, picture)
        if len(self.mirroring):
            add_transported(
                self.mirror, self.mirror_scale, *_shining(mirrored), self.mirroring, picture
            )


def _shining(light: Array) -> tuple[NDArray[np.int64], _FLOATS]:
    """Return which cells give light, and theirs; filled up to a multiple of 4 with darkness."""
    cells = np.flatnonzero(light.any(axis=1))
    missing = -len(cells) % 4
    shone = np.pad(light[cells].astype(np.float32), ((0, missing), (0, 0)))
    return np.pad(cells, (0, missing)), shone


@dataclass(frozen=True, eq=False)
class NarrowTransport:
    """What samples pass on of one narrow light, times their colours.

    Attributes
    ----------
    matt : (tiles, TILE) float32
    mirror : (mirroring tiles, TILE) float32
    """

    matt: _FLOATS
    mirror: _FLOATS


@dataclass(frozen=True, eq=False)
class Colours:
    """What the samples of a picture make of light.

    Attributes
    ----------
    matt : (tiles, 3, TILE) float32
        ρ / π.
    mirroring : (mirroring tiles,) intp
        Tiles that mirror too.
    mirror : (mirroring tiles, 3, TILE) float32
    """

    matt: _FLOATS
    mirroring: NDArray[np.intp]
    mirror: _FLOATS

    def add(
        self,
        narrow: Sequence[NarrowTransport],
        irradiance: Array,
        mirrored: Array,
        picture: _FLOATS,
    ) -> None:
        """Add the radiance under narrow lights to `picture` (tiles, 3, TILE).

        `irradiance`, (K, 3), is what reaches matt surfaces, `mirrored` what the others show.
        """
        if not narrow:
            return
        # A tuple's length is part of its compiled type: one length, one compilation.
        each = [*narrow, *[narrow[0]] * (NARROW_LIGHTS - len(narrow))]
        tiles = np.arange(len(self.matt))
        matt = tuple(light.matt for light in each)
        add_narrow(matt, irradiance.astype(np.float32), self.matt, tiles, picture)
        if len(self.mirroring) and mirrored.any():
            mirror = tuple(light.mirror for light in each)
            add_narrow(mirror, mirrored.astype(np.float32), self.mirror, self.mirroring, picture)
