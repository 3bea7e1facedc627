"""Pictures that were drawn smaller than they are shown, because there was no time for more."""

import cv2
import numpy as np
from numpy.typing import NDArray


def enlarged(radiance: NDArray[np.float32], size_px: tuple[int, int]) -> NDArray[np.float32]:
    """Return a picture (h, w, 4) as one of (width, height), bilinear between its pixels.

    Nothing becomes brighter than it is or negative; outlines are as soft as a pixel was wide.
    """
    if (radiance.shape[1], radiance.shape[0]) == size_px:
        return radiance
    larger = cv2.resize(radiance, size_px, interpolation=cv2.INTER_LINEAR)
    return np.asarray(larger, np.float32)
