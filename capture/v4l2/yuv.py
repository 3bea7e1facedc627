"""Luma and chroma of video to R, G, B, by the matrix and the range that the driver names.

Input  : Y, Cb, Cr planes in DN.    Output : counts, (H, W, 3) uint8.
Cost   : about 8 ms for a picture of 2 megapixels.
Fails  : colours are coarser than the picture: Cb and Cr are shared by two or four pixels, and are
         repeated here. Cameras that name no matrix or range get those of their colour space.
"""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.v4l2.formats import PictureFormat

# Numbers of linux/videodev2.h; 0 is "default" in each of them.
_SMPTE240M, _REC709, _JPEG, _BT2020, _DCI_P3 = 2, 3, 7, 10, 12  # enum v4l2_colorspace
_ENC_601, _ENC_709, _ENC_BT2020, _ENC_240M = 1, 2, 6, 8  # enum v4l2_ycbcr_encoding
_ENCODING_OF_SPACE = {
    _REC709: _ENC_709,
    _DCI_P3: _ENC_709,
    _BT2020: _ENC_BT2020,
    _SMPTE240M: _ENC_240M,
}
_LUMA_WEIGHTS = {  # of red and blue
    _ENC_601: (0.299, 0.114),
    3: (0.299, 0.114),  # xvYCC 601, which differs only outside the gamut
    5: (0.299, 0.114),  # sYCC
    _ENC_709: (0.2126, 0.0722),
    4: (0.2126, 0.0722),  # xvYCC 709
    _ENC_BT2020: (0.2627, 0.0593),
    _ENC_240M: (0.212, 0.087),
}
_FULL_RANGE, _LIMITED_RANGE = 1, 2  # enum v4l2_quantization


def is_full_range(picture: PictureFormat) -> bool:
    """Tell whether Y goes from 0 to 255, not from 16 to 235."""
    default = _FULL_RANGE if picture.colorspace == _JPEG else _LIMITED_RANGE
    return (picture.quantization or default) == _FULL_RANGE


def rgb_from_yuv(yuv: NDArray[np.uint8], picture: PictureFormat) -> NDArray[np.uint8]:
    """Return R, G, B of (H, W, 3) Y, Cb, Cr, to within 1 DN; what lies beyond is cut off."""
    encoding = picture.ycbcr_enc or _ENCODING_OF_SPACE.get(picture.colorspace, _ENC_601)
    matrix = _matrix(encoding, is_full_range(picture))
    return np.asarray(cv2.transform(yuv, matrix), np.uint8)


def full_range_luma(luma: NDArray[np.uint8], picture: PictureFormat) -> NDArray[np.uint8]:
    """Return Y spread over 0 … 255, as neutral colours have it in R, G and B."""
    if is_full_range(picture):
        return luma
    return _SPREAD[luma]


_SPREAD = np.clip(np.rint((np.arange(256) - 16) * (255 / 219)), 0, 255).astype(np.uint8)


@cache
def _matrix(encoding: int, full_range: bool) -> NDArray[np.float64]:
    """Return the (3, 4) affine map from Y, Cb, Cr to R, G, B, all in DN of 8 bits."""
    red, blue = _LUMA_WEIGHTS.get(encoding, _LUMA_WEIGHTS[_ENC_601])
    green = 1 - red - blue
    to_rgb = np.array(
        [
            [1, 0, 2 - 2 * red],
            [1, -(2 - 2 * blue) * blue / green, -(2 - 2 * red) * red / green],
            [1, 2 - 2 * blue, 0],
        ]
    )
    scale = np.ones(3) if full_range else np.array([255 / 219, 255 / 224, 255 / 224])
    zero = np.array([0, 128, 128]) if full_range else np.array([16, 128, 128])
    linear = to_rgb * scale
    return np.column_stack([linear, -linear @ zero])
