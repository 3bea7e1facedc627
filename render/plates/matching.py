"""One scale for a plate and the lights that are to stand in it.

What the plate shows of the ground, P, the light that falls on it, E, and its albedo ρ belong
together: P = gain · ρ E / π, in each channel. So of gain and albedo one has to be known:

| known is | for instance from | gain | albedo |
|---|---|---|---|
| the gain | a plate of the lights' own camera | as given | π P / (gain E) |
| the ground's light | a map that sees it | of each channel: white balance too | π P / (gain E) |
| the albedo | a guess | one, by luminance | in the plate's colour |

Fails  : where the plate's ground lies in a shadow that the lights do not know, or is glossy, or is
         not what most of the map's ground is: objects are then too dark or too bright by as much.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from lighting.photometry.albedo import LEAST_GROUND, ground_radiance
from lighting.photometry.illuminance import cosine_weights
from render.plates.plate import Plate
from render.plates.plate_camera import pixels_of
from render.scenes.scene import Camera

Array = NDArray[np.float64]

_STEPS = 48
_DARKEST = 1e-3
"""Albedo below which a channel is noise."""


@dataclass(frozen=True, eq=False)
class Match:
    """How the lights' scale becomes the plate's, and what ground goes with it.

    Attributes
    ----------
    gain : (3,) float64
        The plate's linear value of radiance 1 of the lights.
    reflectance : (3,) float64
        Albedo of the ground, in (0, 1].
    """

    gain: Array
    reflectance: Array


def ground_seen(plate: Plate, camera: Camera, point: Array, radius_m: float) -> Array:
    """Return what the plate shows of the ground around a point (3,): the median of each channel.

    Raises
    ------
    InputError
        If the picture does not show it, or it is black.
    """
    steps = radius_m * np.linspace(-1, 1, _STEPS)
    x, z = (each.ravel() for each in np.meshgrid(steps, steps))
    is_in = np.hypot(x, z) <= radius_m
    offsets = np.stack([x, np.zeros_like(x), z], axis=-1)[is_in]
    pixels = np.rint(pixels_of(camera, point + offsets)).astype(np.int64)
    width, height = camera.size_px
    pixels = pixels[np.all((pixels >= 0) & (pixels < (width, height)), axis=1)]
    if len(pixels) == 0:
        raise InputError("the plate does not show the ground on which the objects are to stand")
    seen = np.median(plate.radiance[pixels[:, 1], pixels[:, 0]], axis=0).astype(np.float64)
    if not np.all(seen > 0):
        raise InputError("the plate is black where the objects are to stand: it tells no exposure")
    return seen


def gain_of_ground(seen: Array, environment: EnvironmentMap) -> Array | None:
    """Return the gain (3,) by which a map's ground becomes what the plate shows of it, `seen` (3,).

    The map's is the median of each channel over the lower half, by the cosine: lines on the ground,
    and what else stands on it, change that less than a mean. None where next to nothing was seen.
    """
    _, share = ground_radiance(environment)
    if share < LEAST_GROUND:
        return None
    weights = cosine_weights(environment.height, (0.0, -1.0, 0.0))[environment.valid]
    radiance = environment.radiance[environment.valid]
    of_map = np.array([_median(radiance[:, c], weights) for c in range(3)])
    return seen / of_map if np.all(of_map > 0) else None


def match_gain(seen: Array, received: Array, gain: Array) -> Match:
    """Return the match for a known gain (3,); `seen` (3,) is P, `received` (3,) is E."""
    with np.errstate(divide="ignore"):
        reflectance = np.pi * seen / (gain * received)
    return Match(gain, np.clip(reflectance, _DARKEST, 1.0))


def match_albedo(seen: Array, received: Array, albedo: float) -> Match:
    """Return the match for ground of a known albedo and unknown colour."""
    if not 0 < albedo <= 1:
        raise InputError(f"an albedo lies above 0 and up to 1, got {albedo:g}")
    if not np.all(received > 0):
        raise InputError("the lights leave the ground dark, and the plate does not: give its gain")
    shown, lit = float(seen @ LUMINANCE_WEIGHTS), float(received @ LUMINANCE_WEIGHTS)
    return match_gain(seen, received, np.full(3, math.pi * shown / (albedo * lit)))


def _median(values: NDArray[np.float32], weights: Array) -> float:
    order = np.argsort(values)
    sums = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, sums[-1] / 2)])
