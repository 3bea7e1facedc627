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
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.maps.remap_image import remap_image
from lighting.maps.spherical_registration import Turn, register_turn
from lighting.sphere.latlong import cell_directions

Array = NDArray[np.float64]

_REGISTRATION_HEIGHT = 128
_LEAST_CORRELATION = 0.5
_SHARPNESS_POWER = 4
"""Of pixels per radian, in the weights: high enough for one picture to decide nearly everywhere,
so that what does not fit together is not blurred."""
_HIDDEN_FADE = 1.5
_LEAST_SAY = 0.25
"""Of the weight of what was measured: that of a lower bound from which on it can contradict. One
that was seen more coarsely is smeared over cells beside it."""


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
        trust(view.calibration, environment, hidden_rad)[0]
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


def combine_views(
    views: Sequence[View], height: int, hidden_rad: float = 0.0
) -> tuple[EnvironmentMap, Array]:
    """Return the map of `height` rows of pictures whose poses fit together, and its confidence.

    A cell is the mean of what the pictures show there, weighted by how finely each sees it. Clipped
    pictures count where all are, or where they saw about as finely as the others and more light
    than those; there the cell is clipped. So pictures of different exposures, cropped so that they
    cannot be merged, can be combined. A cell is valid if any picture saw it.

    The confidence (N, 2N) of a cell is how many pixels wide it was in the picture, the way it was
    narrowest, 1 at most: less on the stretched rim of a mirror ball, 0 in its blind cone.

    Parameters
    ----------
    views : sequence of View
        All in the same unit.
    height : int
    hidden_rad : float
        Angle from a picture's axis within which it shows the camera or who holds it. It is not
        used there, and fades in up to 1.5 times that angle.

    Raises
    ------
    InputError
        If the pictures are in different units.
    """
    scales = {view.image.scale for view in views}
    if len(scales) > 1:
        raise InputError(f"the pictures are in different units: {', '.join(sorted(scales))}")
    # Of what is measured, and of lower bounds: weight, its sum with the light, and with the detail.
    sums = np.zeros((2, height, 2 * height, 5))
    for view in views:
        environment = remap_image(view.calibration, view.image, height)
        weight, sharpness = trust(view.calibration, environment, hidden_rad)
        detail = np.minimum(sharpness * np.pi / height, 1.0)
        shown = np.concatenate(
            [np.ones_like(weight)[..., None], environment.radiance, detail[..., None]], axis=-1
        )
        for total, counts in zip(sums, (~environment.clipped, environment.clipped), strict=True):
            total += (weight * counts)[..., None] * shown
    weights = sums[..., :1]
    means = np.divide(sums[..., 1:], weights, out=np.zeros_like(sums[..., 1:]), where=weights > 0)
    measured, bound = luminance(means[..., :3])
    valid = weights.sum(axis=0)[..., 0] > 0
    clipped = (bound > measured) & (weights[1] >= _LEAST_SAY * weights[0])[..., 0]
    chosen = np.where(clipped[..., None], means[1], means[0])
    combined = EnvironmentMap(chosen[..., :3].astype(np.float32), valid, clipped, scales.pop())
    return combined, chosen[..., 3]


def trust(
    calibration: Calibration, environment: EnvironmentMap, hidden_rad: float
) -> tuple[Array, Array]:
    """Return the weight (N, 2N) of a picture in each cell of its map, and pixels per radian there.

    The weight is 0 where the picture shows nothing, or is not to be used.
    """
    world = cell_directions(environment.height)
    sharpness = pixels_per_rad(calibration.model, world @ calibration.R_world_camera)
    angle = calibration.axis_angle(world)
    if hidden_rad > 0:
        shown = np.clip((angle / hidden_rad - 1.0) / (_HIDDEN_FADE - 1.0), 0.0, 1.0)
    else:
        shown = np.ones_like(angle)
    weight = shown * (sharpness / max(float(sharpness.max()), 1e-12)) ** _SHARPNESS_POWER
    usable = environment.valid & (angle <= calibration.valid_angle_rad)
    return np.where(usable, weight, 0.0), sharpness
