"""One environment map of several pictures of a place, each direction from who saw it best.

Input  : pictures with their calibrations.    Output : an EnvironmentMap.
Two pictures of a mirror ball, the camera moved by 90° around it, see all of the sphere well: where
one shows the camera, or the rim and the blind cone behind the ball, the other looks from the side.
From opposite sides each would show its camera where the other is blind.
Fails  : by parallax. A ball sees things from its surface, so that one at the distance d appears up
to 2 R/d rad apart in the two pictures, and is blended or doubled where they meet.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.sharpness import pixels_per_rad
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.maps.environment import EnvironmentMap
from lighting.maps.remap import remap_image
from lighting.maps.spherical_registration import Turn, register_turn
from lighting.sphere.latlong import cell_directions

Array = NDArray[np.float64]

_REGISTRATION_HEIGHT = 128
_LEAST_CORRELATION = 0.5
_SHARPNESS_POWER = 4
"""Of pixels per radian, in the weights: high enough for one picture to decide nearly everywhere,
so that what does not fit together is not blurred."""
_HIDDEN_FADE = 1.5
_NEGLIGIBLE = 0.01
"""Share of the weight below which a picture does not pass on its mark `clipped`."""


@dataclass(frozen=True, eq=False)
class View:
    """A picture, and how its camera saw."""

    image: RadianceImage
    calibration: Calibration


def align_views(views: Sequence[View], hidden_rad: float = 0.0) -> tuple[list[View], list[Turn]]:
    """Return the views with their poses made to fit the first's, and by what each was turned.

    Raises
    ------
    InputError
        If a picture does not resemble the first in any direction.
    """
    maps = [remap_image(view.calibration, view.image, _REGISTRATION_HEIGHT) for view in views]
    trusts = [
        trust(view.calibration, environment, hidden_rad)
        for view, environment in zip(views, maps, strict=True)
    ]
    aligned, turns = [views[0]], []
    for number in range(1, len(views)):
        turn = register_turn(maps[0].radiance, maps[number].radiance, trusts[0], trusts[number])
        if turn.correlation < _LEAST_CORRELATION:
            raise InputError(
                f"picture {number + 1} does not fit the first however it is turned (correlation "
                f"{turn.correlation:.2f}, wanted {_LEAST_CORRELATION}): check that both show the "
                "same place under the same light, and their calibrations' pitch and roll"
            )
        camera = views[number].calibration
        pose = turn.R_first_second @ camera.R_world_camera
        aligned.append(replace(views[number], calibration=replace(camera, R_world_camera=pose)))
        turns.append(turn)
    return aligned, turns


def combine_views(views: Sequence[View], height: int, hidden_rad: float = 0.0) -> EnvironmentMap:
    """Return the map of `height` rows of pictures whose poses fit together.

    A cell is the mean of what the pictures show there, weighted by how finely each sees it; it is
    clipped if one is that contributed 1 % or more, and valid if any saw it.

    Parameters
    ----------
    views : sequence of View
        All in the same unit.
    height : int
    hidden_rad : float
        Angle from a picture's axis within which it shows the camera or who holds it. It is not
        used there, and fades in up to 1.5 times that angle.
    """
    scales = {view.image.scale for view in views}
    if len(scales) > 1:
        raise InputError(f"the pictures are in different units: {', '.join(sorted(scales))}")
    total = np.zeros((height, 2 * height))
    light = np.zeros((height, 2 * height, 3))
    marked = np.zeros((height, 2 * height))
    for view in views:
        environment = remap_image(view.calibration, view.image, height)
        weight = trust(view.calibration, environment, hidden_rad)
        total += weight
        light += weight[..., None] * environment.radiance
        marked += weight * environment.clipped
    valid = total > 0
    radiance = np.zeros_like(light)
    np.divide(light, total[..., None], out=radiance, where=valid[..., None])
    clipped = valid & (marked >= _NEGLIGIBLE * total)
    return EnvironmentMap(radiance.astype(np.float32), valid, clipped & (marked > 0), scales.pop())


def trust(calibration: Calibration, environment: EnvironmentMap, hidden_rad: float) -> Array:
    """Return the weight (N, 2N) of a picture in each cell of its map; 0 where it has none."""
    world = cell_directions(environment.height)
    sharpness = pixels_per_rad(calibration.model, world @ calibration.R_world_camera)
    angle = calibration.axis_angle(world)
    if hidden_rad > 0:
        shown = np.clip((angle / hidden_rad - 1.0) / (_HIDDEN_FADE - 1.0), 0.0, 1.0)
    else:
        shown = np.ones_like(angle)
    weight = shown * (sharpness / max(float(sharpness.max()), 1e-12)) ** _SHARPNESS_POWER
    return np.where(environment.valid & (angle <= calibration.valid_angle_rad), weight, 0.0)
