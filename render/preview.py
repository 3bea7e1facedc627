"""A map and its lights as a picture for people: where lights sit, what was clipped or unseen."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lighting.environment import EnvironmentMap
from lighting.latlong import direction_to_grid
from lighting.light_set import LightSet
from render.view import to_display

LIGHT_RGB = (255, 190, 0)
OUTLINE_RGB = (0, 0, 0)
CLIPPED_RGB = (255, 0, 160)
UNSEEN_RGB = (60, 60, 70)
SUBPIXEL_BITS = 4


def preview(
    environment: EnvironmentMap, lights: LightSet, exposure_ev: float, width_px: int = 1024
) -> NDArray[np.uint8]:
    """Return the map as (width/2, width, 3) sRGB with a ring at each light.

    A pixel is magenta if any of its cells is clipped, and hatched grey if most are unseen; the area
    of a ring is proportional to its light's share of the irradiance, within the limits of what can
    be seen.
    """
    size_px = (width_px, width_px // 2)
    picture = _resize(to_display(environment.radiance, exposure_ev), size_px)
    unseen = _resize((~environment.valid).astype(np.float32), size_px) > 0.5
    picture[unseen] = UNSEEN_RGB
    picture[unseen & _hatch(size_px)] = np.add(UNSEEN_RGB, 25)
    picture[_resize(environment.clipped.astype(np.float32), size_px) > 0] = CLIPPED_RGB
    scale = size_px[1] / environment.height
    centres = (direction_to_grid(lights.directions, environment.height) + 0.5) * scale - 0.5
    power = lights.irradiance.sum(axis=1)
    share = power / max(power.sum(), np.finfo(float).tiny)
    radii_px = np.clip(0.06 * width_px * np.sqrt(share), 3, 0.06 * width_px)
    for radius_px, (x, y) in zip(radii_px, centres, strict=True):
        for colour, thickness in ((OUTLINE_RGB, 3), (LIGHT_RGB, 1)):
            for turn_px in (-width_px, 0, width_px):  # across the seam it goes on at the other edge
                _ring(picture, (x + turn_px, y), float(radius_px), colour, thickness)
    return picture


def _resize(picture: NDArray[Any], size_px: tuple[int, int]) -> NDArray[Any]:
    """Mean of the cells in a pixel, or the cell that a pixel lies in if the map is smaller."""
    shrinks = size_px[0] < picture.shape[1]
    return cv2.resize(
        picture, size_px, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_NEAREST
    )


def _ring(
    picture: NDArray[np.uint8],
    centre: tuple[float, float],
    radius_px: float,
    colour: tuple[int, int, int],
    thickness: int,
) -> None:
    fixed = 1 << SUBPIXEL_BITS
    cv2.circle(
        picture,
        (round(centre[0] * fixed), round(centre[1] * fixed)),
        round(radius_px * fixed),
        colour,
        thickness,
        cv2.LINE_AA,
        SUBPIXEL_BITS,
    )


def _hatch(size_px: tuple[int, int]) -> NDArray[np.bool_]:
    width, height = size_px
    rows, columns = np.mgrid[0:height, 0:width]
    return ((rows + columns) // max(1, height // 64)) % 4 == 0
