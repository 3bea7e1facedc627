"""Photographs for tests: pictures with the EXIF tags that a camera writes, by Pillow."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"

_EXIF_DIRECTORY = 0x8769
_MODEL, _ORIENTATION = 272, 274
_EXPOSURE_TIME, _F_NUMBER, _ISO, _TAKEN, _FRACTION = 33434, 33437, 34855, 36867, 37521


def scene_picture(time_s: float, size_px: tuple[int, int] = (48, 32)) -> NDArray[np.uint8]:
    """A ramp of radiance seen through the sRGB curve: its exposures agree with their labels."""
    width, height = size_px
    ramp = np.geomspace(0.01, 100.0, width * height).reshape(height, width, 1)
    linear = np.clip(ramp * time_s * np.array([1.0, 0.8, 0.6]), 0, 1)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255 * coded).astype(np.uint8)


def _rational(value: float) -> IFDRational:
    fraction = Fraction(value).limit_denominator(10**6)
    return IFDRational(fraction.numerator, fraction.denominator)


def write_photograph(
    path: Path,
    time_s: float | None = None,
    *,
    picture: NDArray[np.uint8] | None = None,
    iso: int | None = 100,
    f_number: float | None = 8.0,
    taken: str | None = None,
    fraction: str | None = None,
    camera: str = "Test 1",
    orientation: int = 1,
) -> Path:
    """Write a JPEG, of `scene_picture` unless another is given; None leaves a tag out."""
    tags: dict[int, Any] = {
        _EXPOSURE_TIME: None if time_s is None else _rational(time_s),
        _F_NUMBER: None if f_number is None else _rational(f_number),
        _ISO: iso,
        _TAKEN: taken,
        _FRACTION: fraction,
    }
    exif = Image.Exif()
    exif[_MODEL] = camera
    exif[_ORIENTATION] = orientation
    exif.get_ifd(_EXIF_DIRECTORY).update(
        {number: value for number, value in tags.items() if value is not None}
    )
    if picture is None:
        picture = scene_picture(time_s or 0.01)
    Image.fromarray(picture).save(path, exif=exif, quality=95, subsampling=0)
    return path
