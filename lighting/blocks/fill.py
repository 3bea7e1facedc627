"""What to assume about directions that the camera did not see.

Input  : an environment map or block sums, in part unseen.    Output : the same, with a guess there.
What is unseen stays marked so: it was filled, not measured.
"""

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from capture.errors import InputError
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.summed_area import block_sums
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from lighting.sphere.latlong import solid_angles

Fill = Literal["black", "mean", "mirror"]
"""Black; the mean radiance of what was seen; what was seen mirrored at the horizon."""

_HALF = 0.5
"""Share of a block that must be seen for it to be mirrored."""
_ROUNDING_SR = 1e-9

_UPSIDE_DOWN = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
"""Signs of sums over a block that is mirrored at the horizon: of ∫Y d dω, y turns."""


def fill_unseen(environment: EnvironmentMap, fill: Fill) -> EnvironmentMap:
    """Return the map with its unseen cells filled.

    "mean" is weighted by solid angle. "mirror" takes the cell as far on the other side of the
    horizon, and the mean where that was not seen either: a fair guess for the ground under a sky,
    which reflects it, but a sun is then there twice; the mirror image of a clipped cell is a lower
    bound too, and marked.

    Raises
    ------
    InputError
        If there is no such fill, or "mean" or "mirror" is asked of a map without a seen cell.
    """
    _check(fill)
    seen = environment.valid
    radiance = np.where(seen[..., None], environment.radiance, np.float32(0))
    clipped = environment.clipped.copy()
    if fill != "black" and not seen.all():
        weight = seen * solid_angles(environment.height)[:, None]
        total = weight.sum()
        if total == 0:
            raise InputError(f"no part of the map was seen, so it cannot be filled by its {fill}")
        mean = np.einsum("rc,rck->k", weight, radiance, dtype=np.float64) / total
        radiance[~seen] = mean
        if fill == "mirror":
            from_mirror = ~seen & seen[::-1]
            radiance[from_mirror] = radiance[::-1][from_mirror]
            clipped |= from_mirror & environment.clipped[::-1]
    return replace(environment, radiance=radiance, clipped=clipped)


def fill_blocks(blocks: BlockSums, fill: Fill) -> BlockSums:
    """Return block sums with the unseen share of each block filled, as `fill_unseen` does a map.

    A block that is seen in part gets the fill for the rest of its solid angle. "mirror" takes the
    mean of the block as far on the other side of the horizon, if half of that was seen.

    Raises
    ------
    InputError
        If there is no such fill, or "mean" or "mirror" is asked where nothing was seen.
    """
    _check(fill)
    if fill == "black" or not blocks.unseen_sr.any():
        return blocks
    rows, columns = blocks.unseen_sr.shape
    per_sr = block_sums(np.ones((rows, columns, 3), np.float32)) / solid_angles(rows)[:, None, None]
    seen_sr = solid_angles(rows)[:, None] - blocks.unseen_sr
    if seen_sr.sum() <= _ROUNDING_SR:
        raise InputError(f"nothing of the sphere was seen, so it cannot be filled by its {fill}")
    mean = blocks.integral() / seen_sr.sum()
    per_sr *= np.concatenate([np.full(4, mean @ LUMINANCE_WEIGHTS), mean])
    clipped = blocks.clipped
    if fill == "mirror":
        mirror_sr = seen_sr[::-1]
        has_mirror = mirror_sr >= _HALF * solid_angles(rows)[:, None]
        mirrored = blocks.sums[::-1] * _UPSIDE_DOWN
        per_sr[has_mirror] = mirrored[has_mirror] / mirror_sr[has_mirror, None]
        share = np.divide(
            blocks.unseen_sr, mirror_sr, out=np.zeros_like(mirror_sr), where=has_mirror
        )
        clipped = clipped + share * clipped[::-1]
    return replace(blocks, sums=blocks.sums + blocks.unseen_sr[..., None] * per_sr, clipped=clipped)


def _check(fill: str) -> None:
    if fill not in get_args(Fill):
        raise InputError(f"fill must be {', '.join(get_args(Fill))}, got {fill}")
