"""Environment maps on disk: lat-long pictures of this program and of others.

Input  : .exr or .hdr, N × 2N.    Output : an EnvironmentMap on the grid of CONVENTIONS.md.
A file is taken to be oriented as OpenEXR, USD and Mitsuba do it, and its pixels to be cells. Only
OpenEXR's attribute `envmap` says otherwise: by its definition the outermost pixel centres lie on
the seam and on the poles, and such a picture is resampled onto cells. Maps are written without it.
Fails  : on a picture that another program has turned or mirrored; nothing in a file tells.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.radiance import Cleaned, clean_radiance
from capture.radiance_files import read_hdr, write_hdr
from lighting.maps.environment import EnvironmentMap


def read_environment(path: Path) -> tuple[EnvironmentMap, Cleaned]:
    """Return a file's environment map fit for use, and what had to be removed from it.

    NaN and infinite values become cells that are 0 and not valid. Cells that the file marks as not
    valid hold what they were filled with.

    Raises
    ------
    UnreadableFrame
        If the file is truncated or damaged.
    InputError
        If it does not exist, is of another kind, its width is not twice its height, or none of its
        pixels is finite.
    """
    picture = read_hdr(path)
    height, width = picture.rgb.shape[:2]
    if width != 2 * height or height < 2:
        raise InputError(
            f"{path}: wanted a lat-long map, twice as wide as high, found {width}×{height}; "
            "a camera picture becomes one with `fishlight remap`"
        )
    cleaned = clean_radiance(picture.rgb, picture.notes)
    if not cleaned.valid.any():
        raise InputError(f"{path}: not one of its pixels is a finite number")
    radiance = cleaned.radiance
    valid = cleaned.valid if picture.valid is None else cleaned.valid & picture.valid
    clipped = np.zeros_like(valid) if picture.clipped is None else picture.clipped
    if "LATLONG" in str(picture.attributes.get("envmap", "")):
        radiance = _cells_from_centres(radiance)
        valid = _cells_from_centres(valid.astype(np.float32)) > 1 - 1e-6
        clipped = _cells_from_centres(clipped.astype(np.float32)) > 0
    return EnvironmentMap(radiance, valid, clipped, picture.scale), cleaned


def write_environment(
    path: Path,
    environment: EnvironmentMap,
    *,
    force: bool = True,
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write a map with its marks to an .exr file, or its colours alone to a .hdr file."""
    write_hdr(
        path,
        environment.radiance,
        valid=environment.valid,
        clipped=environment.clipped,
        scale=environment.scale,
        attributes=attributes,
        force=force,
    )


def _cells_from_centres(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return cells of a picture, (N, 2N, ...), whose outermost centres are the seam and poles.

    Linear in both directions. Source and cells are nearly equally dense, so a one-pixel light
    keeps its flux to 1/N.
    """
    for axis, size in enumerate(picture.shape[:2]):
        place = (np.arange(size) + 0.5) / size * (size - 1)
        before = np.floor(place).astype(int)
        share = (place - before).astype(np.float32).reshape([-1] + [1] * (picture.ndim - axis - 1))
        picture = (1 - share) * picture.take(before, axis) + share * picture.take(before + 1, axis)
    return picture
