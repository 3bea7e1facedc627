"""From a single camera picture of any size to an environment map, in bounded memory."""

import numpy as np

from calibration.camera import Calibration
from capture.radiance import RadianceImage
from lighting.maps.environment import EnvironmentMap
from lighting.maps.footprint import BAND_PARTS, add_band, row_balance
from lighting.maps.pixel_grid import pixel_corners, pixel_illumination, pixel_reflected
from lighting.maps.remap import HALF, apply_remap, build_remap
from lighting.sphere.latlong import solid_angles

_OPERATOR_PX = 8_000_000
"""Largest picture for which a whole operator is built on the way."""

_BAND_PX = 1_000_000


def remap_image(calibration: Calibration, image: RadianceImage, height: int) -> EnvironmentMap:
    """Return the environment map of one picture, in memory bounded by the map and not the picture.

    A picture of at most 8 Mpx goes through `build_remap`. A larger one is taken in bands whose
    light is added up straight away. That cannot be balanced, and is finely sampled instead: the
    two ways differ by less than 1 % in the flux of a one-pixel light.

    Raises
    ------
    InputError
        If the picture's size is not the calibration's.
    """
    calibration.check_size(image.size_px, "the picture")
    columns, rows = image.size_px
    if rows * columns <= _OPERATOR_PX:
        return apply_remap(build_remap(calibration, height), image)
    factors = row_balance(height)
    flux = np.zeros((BAND_PARTS, 2 * height**2, 3))
    seen_sr = np.zeros((BAND_PARTS, 2 * height**2))
    clipped = np.zeros(2 * height**2, np.bool_)
    band_rows = max(_BAND_PX // columns, 1)
    for first in range(0, rows, band_rows):
        last = min(first + band_rows, rows)
        corners, seen = pixel_corners(calibration, first, last)
        band = image.radiance[first:last]
        if calibration.reflectance:
            band = band / pixel_reflected(calibration, first, last).reshape(band.shape)
        add_band(
            corners,
            seen & image.valid[first:last],
            factors,
            band,
            pixel_illumination(calibration, first, last).reshape(-1, columns),
            image.clipped[first:last],
            flux,
            seen_sr,
            clipped,
        )
    total_sr = seen_sr.sum(axis=0)
    valid = total_sr >= HALF * np.repeat(solid_angles(height), 2 * height)
    radiance = np.zeros((2 * height**2, 3), np.float32)
    radiance[valid] = flux.sum(axis=0)[valid] / total_sr[valid, None]
    shape = (height, 2 * height)
    return EnvironmentMap(
        radiance.reshape(*shape, 3), valid.reshape(shape), clipped.reshape(shape), image.scale
    )
