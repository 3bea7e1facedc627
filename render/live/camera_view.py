"""The camera's picture as it is shown: thinned out, and judged for what is wrong with it."""

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from capture.radiance import RadianceImage
from lighting.light_set import LightSet
from render.live.desk import State

CAMERA_WIDTH_PX = 480
"""About the width at which the camera's picture is shown."""

ALL_CLIPPED = 0.9
"""Share of the seen pixels from which on there is nothing to be measured."""


def state_of(lights: LightSet, camera: RadianceImage) -> State:
    """Return how a session is that sees this."""
    seen = np.count_nonzero(camera.valid)
    if seen and np.count_nonzero(camera.clipped & camera.valid) >= ALL_CLIPPED * seen:
        return State(
            "clipped",
            "Everything is too bright for the shortest exposure: the lights are a lower bound. "
            "Give shorter exposures, or close the aperture.",
        )
    if not lights.integral().any():
        return State("dark", "No light: is the cap on the lens, or are the exposures too short?")
    return State("running")


def _step(size_px: tuple[int, int]) -> int:
    return max(1, round(size_px[0] / CAMERA_WIDTH_PX))


def seen_pixels(calibration: Calibration) -> NDArray[np.bool_]:
    """Return which of the thinned-out pixels the calibration says are seen."""
    width, height = calibration.image_size_px
    step = _step(calibration.image_size_px)
    at = np.stack(np.meshgrid(np.arange(0, width, step), np.arange(0, height, step)), axis=-1)
    return calibration.unproject(at)[1]


def thinned(image: RadianceImage, is_seen: NDArray[np.bool_]) -> RadianceImage:
    """Return every n-th pixel, clipped if any that it stands for is; unseen ones not valid.

    The session's own picture is written over by the next bracket's; this one lasts.
    """
    step = _step(image.size_px)
    radiance = image.radiance[::step, ::step].copy()
    clipped = np.zeros(is_seen.shape, np.bool_)
    if image.clipped.any():
        for row in range(step):
            for column in range(step):
                part = image.clipped[row::step, column::step]
                clipped[: part.shape[0], : part.shape[1]] |= part
    valid = image.valid[::step, ::step] & is_seen
    return RadianceImage(
        radiance, np.zeros_like(radiance), valid, clipped & is_seen, image.scale, image.primaries
    )
