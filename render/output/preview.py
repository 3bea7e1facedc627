"""A map and its lights as a picture for people: where lights sit, what was clipped or unseen."""

from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.radiance import RadianceImage
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import direction_to_grid
from render.output.view import to_display

LIGHT_RGB = (255, 190, 0)
KEY_RGB = (0, 220, 255)
OUTLINE_RGB = (0, 0, 0)
CLIPPED_RGB = (255, 0, 160)
UNSEEN_RGB = (60, 60, 70)
SUBPIXEL_BITS = 4
EDGE_STEPS = 96


def preview(
    environment: EnvironmentMap, lights: LightSet, exposure_ev: float, width_px: int = 1024
) -> NDArray[np.uint8]:
    """Return the map as (width/2, width, 3) sRGB with its marks, and a ring at each light."""
    return with_lights(marked(environment, exposure_ev, (width_px, width_px // 2)), lights)


def with_lights(picture: NDArray[np.uint8], lights: LightSet) -> NDArray[np.uint8]:
    """Return the picture of a map, (N, 2N, 3) sRGB, with a ring at each light, blue for key lights.

    The area of a ring is proportional to its light's share of the irradiance of all lights, within
    the limits of what can be seen. A thin line is the edge of the disc that a light stands for. Of
    the fill, which comes from everywhere, nothing is drawn.
    """
    picture = picture.copy()
    height, width = picture.shape[:2]
    centres = direction_to_grid(lights.directions, height)
    power = lights.irradiance.sum(axis=1)
    share = power / max(power.sum(), np.finfo(float).tiny)
    radii_px = np.clip(0.06 * width * np.sqrt(share), 3, 0.06 * width)
    colours = [KEY_RGB if is_key else LIGHT_RGB for is_key in lights.is_key]
    _draw_edges(picture, lights, colours)
    for radius_px, (x, y), light_rgb in zip(radii_px, centres, colours, strict=True):
        for colour, thickness in ((OUTLINE_RGB, 3), (light_rgb, 1)):
            for turn_px in (-width, 0, width):  # across the seam it goes on at the other edge
                _ring(picture, (x + turn_px, y), float(radius_px), colour, thickness)
    return picture


def marked(
    seen: EnvironmentMap | RadianceImage, exposure_ev: float, size_px: tuple[int, int]
) -> NDArray[np.uint8]:
    """Return a map or a camera's picture as sRGB (height, width, 3), with its marks.

    A pixel is magenta if any clipped one is in it, and hatched grey if most in it are unseen.
    """
    picture = _resize(to_display(seen.radiance, exposure_ev), size_px)
    unseen = _resize((~seen.valid).astype(np.float32), size_px) > 0.5
    picture[unseen] = UNSEEN_RGB
    picture[unseen & _hatch(size_px)] = np.add(UNSEEN_RGB, 25)
    picture[_resize(seen.clipped.astype(np.float32), size_px) > 0] = CLIPPED_RGB
    return picture


def _resize(picture: NDArray[Any], size_px: tuple[int, int]) -> NDArray[Any]:
    """Mean of the cells in a pixel, or the cell that a pixel lies in if the map is smaller."""
    shrinks = size_px[0] < picture.shape[1]
    return cv2.resize(
        picture, size_px, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_NEAREST
    )


def _draw_edges(
    picture: NDArray[np.uint8], lights: LightSet, colours: list[tuple[int, int, int]]
) -> None:
    """Blend in the edges of discs that are wider than a pixel."""
    height, width = picture.shape[:2]
    lines = picture.copy()
    for direction, radius_rad, colour in zip(
        lights.directions, lights.angular_radius_rad, colours, strict=True
    ):
        if radius_rad < np.pi / height:
            continue
        edge = direction_to_grid(_circle(direction, float(radius_rad)), height)
        edge[:, 0] = np.unwrap(edge[:, 0], period=width)
        for turn_px in (-width, 0, width):
            points = np.rint((edge + np.array([turn_px, 0])) * (1 << SUBPIXEL_BITS)).astype(
                np.int32
            )
            cv2.polylines(lines, [points], False, colour, 1, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.addWeighted(lines, 0.5, picture, 0.5, 0.0, dst=picture)


def _circle(direction: NDArray[np.float64], radius_rad: float) -> NDArray[np.float64]:
    """Return unit vectors all around a direction, (n, 3), the last the first again."""
    across, along = np.linalg.svd(direction[None])[2][1:]
    angle = np.linspace(0, 2 * np.pi, EDGE_STEPS + 1)[:, None]
    level = np.cos(angle) * across + np.sin(angle) * along
    return np.cos(radius_rad) * direction + np.sin(radius_rad) * level


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


@cache
def _hatch(size_px: tuple[int, int]) -> NDArray[np.bool_]:
    width, height = size_px
    rows, columns = np.mgrid[0:height, 0:width]
    return ((rows + columns) // max(1, height // 64)) % 4 == 0
