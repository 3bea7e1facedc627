"""What to assume about directions that the camera did not see.

Input  : an environment map with unseen cells.    Output : the map, with a guess in them.
Unseen cells stay marked as not valid: they were filled, not measured.
"""

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from capture.errors import InputError
from lighting.environment import EnvironmentMap
from lighting.latlong import solid_angles

Fill = Literal["black", "mean", "mirror"]
"""Black; the mean radiance of what was seen; what was seen mirrored at the horizon."""


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
    if fill not in get_args(Fill):
        raise InputError(f"fill must be {', '.join(get_args(Fill))}, got {fill}")
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
