"""Plates: photographs and frames that objects are set into, as linear light and back.

Input  : JPEG, PNG or TIFF of 8 bits a channel, EXR or .hdr.
Output : what it shows in linear Rec.709; a file that differs from it only where objects do.
Fails  : 8 bits are taken to be sRGB-coded. What a camera's tone curve did beside is not undone,
         and shadows are then a little too dark or too light; nor is a lens's distortion.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.exif import read_exif
from capture.exr import write_exr
from capture.pictures import PICTURE_SUFFIXES, read_picture, write_png
from capture.radiance import clean_radiance
from capture.radiance_files import HDR_SUFFIXES, read_hdr
from capture.sensor import assumed_sensor, srgb_encode

_FILM_DIAGONAL_MM = math.hypot(36, 24)

_TURNS = {1: 0, 3: 2, 6: -1, 8: 1}
"""Quarters of a turn to the left that set a picture upright, by EXIF's orientation."""


@dataclass(frozen=True, eq=False)
class Plate:
    """A picture that objects are set into.

    Attributes
    ----------
    radiance : (H, W, 3) float32
        Linear Rec.709, upright; 1 is white if it has codes.
    codes : (H, W, 3) uint8 or None
        The sRGB-coded pixels; None of a picture that is linear in its file.
    focal_px : float or None
        Focal length in pixels as EXIF tells it; None where it does not.
    """

    radiance: NDArray[np.float32]
    codes: NDArray[np.uint8] | None
    focal_px: float | None

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height)."""
        return self.radiance.shape[1], self.radiance.shape[0]


def read_plate(path: Path) -> Plate:
    """Return a plate, turned as its EXIF says.

    A lens's equivalent on film is taken to have the same angle along the diagonal.

    Raises
    ------
    UnreadableFrame
        If the file is truncated or damaged.
    InputError
        If it does not exist, is of another kind, has 16 bits a channel or is a mirror image.
    """
    suffix = path.suffix.lower()
    if suffix in HDR_SUFFIXES:
        return Plate(clean_radiance(read_hdr(path).rgb).radiance, None, None)
    if suffix not in PICTURE_SUFFIXES:
        known = ", ".join(sorted(PICTURE_SUFFIXES | HDR_SUFFIXES))
        raise InputError(f"{path}: a plate is a picture ({known})")
    codes = read_picture(path)
    if codes.dtype != np.uint8:
        raise InputError(
            f"{path}: 16 bits a channel, of which nothing tells whether they are linear; save the "
            "plate as .exr, linear, or with 8 bits"
        )
    exif = read_exif(path)
    if exif.orientation not in _TURNS:
        raise InputError(f"{path}: its EXIF says that it is a mirror image; save it as it was seen")
    upright = np.ascontiguousarray(np.rot90(codes, _TURNS[exif.orientation]))
    table = assumed_sensor(np.uint8).linear_table()[:, 0]
    focal_mm = exif.equivalent_focal_length_mm
    diagonal_px = math.hypot(*codes.shape[:2])
    focal_px = None if focal_mm is None else focal_mm / _FILM_DIAGONAL_MM * diagonal_px
    return Plate(table[upright], upright, focal_px)


def check_composite_suffix(path: Path, plate_path: Path) -> None:
    """Raise InputError unless a composite with the plate can be written to `path`."""
    wanted = (".exr",) if plate_path.suffix.lower() in HDR_SUFFIXES else (".png", ".exr")
    if path.suffix.lower() not in wanted:
        raise InputError(
            f"{path}: with a plate such as {plate_path.name} the picture is written as "
            f"{' or '.join(wanted)}, which keep its pixels as they are"
        )


def write_composite(
    path: Path,
    plate: Plate,
    picture: NDArray[np.float32],
    *,
    force: bool,
) -> None:
    """Write a composite (H, W, 3), linear as its plate; what equals the plate keeps its codes.

    An .exr holds it as it is, a .png sRGB-coded and cut off at white.
    """
    if path.suffix.lower() == ".exr":
        write_exr(path, {n: picture[..., c] for c, n in enumerate("RGB")}, {}, force=force)
        return
    assert plate.codes is not None  # check_composite_suffix
    codes = plate.codes.copy()
    changed = picture != plate.radiance
    codes[changed] = np.rint(255 * srgb_encode(np.clip(picture[changed], 0, 1)))
    write_png(path, codes, force=force)
