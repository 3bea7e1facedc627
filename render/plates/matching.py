"""One scale for a plate and the lights that are to stand in it: the ground that both know.

What the plate shows of the ground, P, the light that falls on it, E, and its albedo ρ belong
together: P = gain · ρ E / π, in each channel. So of gain and albedo one has to be known:

| known is | for instance from | gain | albedo |
|---|---|---|---|
| the gain | a plate of the lights' own camera | given | π P / (gain E) |
| the albedo of each channel | a map that sees it | of each channel: white balance too | given |
| the albedo in all | a guess | one, by luminance | in the plate's colour |

Fails  : where the plate's ground lies in a shadow that the lights do not know, or is glossy:
         objects are then too dark or too bright by as much.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.maps.environment import LUMINANCE_WEIGHTS
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


def match_gain(seen: Array, received: Array, gain: float) -> Match:
    """Return the match for one known gain; `seen` (3,) is P, `received` (3,) is E."""
    return _match(seen, received, np.full(3, gain))


def match_ground(seen: Array, received: Array, reflectance: Array) -> Match:
    """Return the match for ground whose albedo is known in each channel, (3,)."""
    _check_lit(received)
    return _match(seen, received, np.pi * seen / (np.maximum(reflectance, _DARKEST) * received))


def match_albedo(seen: Array, received: Array, albedo: float) -> Match:
    """Return the match for ground of a known albedo and unknown colour."""
    if not 0 < albedo <= 1:
        raise InputError(f"an albedo lies above 0 and up to 1, got {albedo:g}")
    _check_lit(received)
    shown, lit = float(seen @ LUMINANCE_WEIGHTS), float(received @ LUMINANCE_WEIGHTS)
    return _match(seen, received, np.full(3, math.pi * shown / (albedo * lit)))


def _match(seen: Array, received: Array, gain: Array) -> Match:
    with np.errstate(divide="ignore"):
        reflectance = np.pi * seen / (gain * received)
    return Match(gain, np.clip(reflectance, _DARKEST, 1.0))


def _check_lit(received: Array) -> None:
    if not np.all(received > 0):
        raise InputError("the lights leave the ground dark, and the plate does not: give its gain")
