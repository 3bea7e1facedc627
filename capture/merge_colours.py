"""Merged radiance of a camera's own channels, turned into that of red, green and blue.

Input  : RadianceImage and the sensor's colour matrix.    Output : RadianceImage.
Cost   : 10 ms per megapixel; nothing for a sensor without a colour matrix.
Fails  : colours outside the primaries have a negative channel, which is cut off at 0: under Rec.709
         the light of a saturated lamp becomes paler. ACEScg holds all but the most saturated.
"""

import cv2
import numpy as np

from capture.radiance import RadianceImage
from capture.sensor import Sensor


def in_colours(
    image: RadianceImage, sensor: Sensor, full_radiance: float | None = None
) -> RadianceImage:
    """Return the radiance in the sensor's primaries, with its variance and its marks.

    Channels of different sensitivity are full at different radiances of white light, so a clipped
    pixel as it is would be magenta. It is first cut off, in all channels, at the white that just
    fills the most sensitive one: each channel stays a lower bound, and a sun becomes white.

    Parameters
    ----------
    image : RadianceImage
        Of the sensor's own channels.
    sensor : Sensor
    full_radiance : float or None
        What a full pixel of the shortest exposure stands for; None cuts nothing off.
    """
    matrix = sensor.colour_matrix
    if matrix is None:
        return image
    radiance = image.radiance
    if full_radiance is not None:
        white = np.linalg.solve(matrix, np.ones(3))
        most = (full_radiance * white / white.max()).astype(np.float32)
        radiance = np.where(image.clipped[..., None], np.minimum(radiance, most), radiance)
    return RadianceImage(
        np.maximum(cv2.transform(radiance, matrix), np.float32(0), dtype=np.float32),
        np.asarray(cv2.transform(image.variance, matrix**2), np.float32),
        image.valid,
        image.clipped,
        image.scale,
        sensor.primaries,
    )
