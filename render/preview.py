"""A map and its lights as a picture for people: where lights sit, what was clipped or unseen."""

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

    Clipped cells are magenta, unseen ones grey with a hatch; the area of a ring is proportional to
    its light's share of the irradiance, within the limits of what can be seen.
    """
    picture = to_display(environment.radiance, exposure_ev)
    picture[environment.clipped] = CLIPPED_RGB
    picture[~environment.valid] = UNSEEN_RGB
    picture[~environment.valid & _hatch(environment.height)] = np.add(UNSEEN_RGB, 25)
    size_px = (width_px, width_px // 2)
    shrinks = width_px < picture.shape[1]
    interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_NEAREST
    picture = np.asarray(cv2.resize(picture, size_px, interpolation=interpolation), np.uint8)
    if len(lights) == 0:
        return picture
    scale = size_px[1] / environment.height
    centres = (direction_to_grid(lights.directions, environment.height) + 0.5) * scale - 0.5
    share = lights.irradiance.sum(axis=1) / lights.irradiance.sum()
    radii_px = np.clip(0.06 * width_px * np.sqrt(share), 3, 0.06 * width_px)
    for radius_px, centre in zip(radii_px, centres, strict=True):
        for colour, thickness in ((OUTLINE_RGB, 3), (LIGHT_RGB, 1)):
            _ring(picture, centre, float(radius_px), colour, thickness)
    return picture


def _ring(
    picture: NDArray[np.uint8],
    centre: NDArray[np.float64],
    radius_px: float,
    colour: tuple[int, int, int],
    thickness: int,
) -> None:
    fixed = 1 << SUBPIXEL_BITS
    cv2.circle(
        picture,
        (round(float(centre[0]) * fixed), round(float(centre[1]) * fixed)),
        round(radius_px * fixed),
        colour,
        thickness,
        cv2.LINE_AA,
        SUBPIXEL_BITS,
    )


def _hatch(height: int) -> NDArray[np.bool_]:
    rows, columns = np.mgrid[0:height, 0 : 2 * height]
    return ((rows + columns) // max(1, height // 64)) % 4 == 0
