"""Radiance on disk: OpenEXR and Radiance .hdr files of this program and of others.

Input  : .exr with R, G, B (or Y), of any primaries; .hdr in any orientation.
Output : linear Rec.709, with the marks (valid, clipped, variance) that came along. Written are also
         other primaries, which the file then names.
In an EXR file the marks are the channels `valid` and `clipped`, 0 or 1, and `variance.R`, `.G` and
`.B`; the attribute `radianceScale` names the unit. Other programs show the colours and pass over
the rest.
Fails  : a file that does not name its primaries is taken to be Rec.709.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.exr import read_exr, write_exr
from capture.primaries import PRIMARIES, REC709, PrimariesName, are_rec709, to_rec709
from capture.radiance import RELATIVE, Cleaned, RadianceImage, check_scale, clean_radiance
from capture.radiance_hdr import read_radiance_hdr, write_radiance_hdr

HDR_SUFFIXES = frozenset((".exr", ".hdr"))

_SCALE = "radianceScale"
_VARIANCE = ("variance.R", "variance.G", "variance.B")


@dataclass(frozen=True)
class HdrPicture:
    """A picture as its file holds it: not cleaned, so it may hold NaN, infinities and negatives.

    Attributes
    ----------
    rgb : (H, W, 3) float32
        Linear Rec.709.
    valid, clipped : (H, W) bool, or None
        Marks, where the file has them.
    variance : (H, W, 3) float32, or None
    scale : str
        "relative" unless the file names a unit.
    notes : tuple of str
        What was done on the way, for people.
    attributes : mapping
        The header of an EXR file; empty for .hdr.
    """

    rgb: NDArray[np.float32]
    valid: NDArray[np.bool_] | None = None
    clipped: NDArray[np.bool_] | None = None
    variance: NDArray[np.float32] | None = None
    scale: str = RELATIVE
    notes: tuple[str, ...] = ()
    attributes: Mapping[str, Any] = field(default_factory=dict)


def check_hdr_suffix(path: Path) -> None:
    """Raise InputError unless `path` is named .exr or .hdr."""
    if path.suffix.lower() not in HDR_SUFFIXES:
        raise InputError(f"{path}: wanted a file named .exr or .hdr")


def read_hdr(path: Path) -> HdrPicture:
    """Return the picture of an .exr or .hdr file.

    Other primaries that the file names are converted to Rec.709, its white adapted to D65 by the
    Bradford transform. Luminance alone (Y) is repeated to grey.

    Raises
    ------
    UnreadableFrame
        If the file is truncated or damaged.
    InputError
        If it does not exist, is of another kind, or has no R, G and B.
    """
    check_hdr_suffix(path)
    return _read_hdr_picture(path) if _is_hdr(path) else _read_exr_picture(path)


def write_hdr(
    path: Path,
    rgb: NDArray[np.floating],
    *,
    valid: NDArray[np.bool_] | None = None,
    clipped: NDArray[np.bool_] | None = None,
    variance: NDArray[np.floating] | None = None,
    scale: str = RELATIVE,
    primaries: PrimariesName = "rec709",
    attributes: Mapping[str, Any] | None = None,
    force: bool = True,
) -> None:
    """Write linear RGB, (H, W, 3), and its marks to an .exr or .hdr file.

    The file names the primaries by their chromaticities.

    A .hdr file holds the colours only: marks, variance, scale and attributes are lost.

    Raises
    ------
    InputError
        If the suffix is neither, the file exists and `force` is False, or a .hdr file cannot hold
        a value: negative, not finite, above 2^126.
    """
    check_hdr_suffix(path)
    if _is_hdr(path):
        write_radiance_hdr(path, rgb, primaries, force=force)
        return
    channels = dict(zip("RGB", np.moveaxis(rgb, -1, 0), strict=True))
    channels |= {
        name: mask.astype(np.float32)
        for name, mask in (("valid", valid), ("clipped", clipped))
        if mask is not None
    }
    if variance is not None:
        channels |= dict(zip(_VARIANCE, np.moveaxis(variance, -1, 0), strict=True))
    chromaticities = tuple(map(float, PRIMARIES[primaries].ravel()))
    header = {**(attributes or {}), "chromaticities": chromaticities, _SCALE: scale}
    write_exr(path, channels, header, force=force)


def read_radiance(path: Path) -> tuple[RadianceImage, Cleaned]:
    """Return a file's radiance fit for use, and what had to be removed from it.

    Pixels that are not valid, by the file's mark or for a NaN or infinite value, are 0. Variance
    is 0, unknown, where the file has none. Raises as `read_hdr` does.
    """
    picture = read_hdr(path)
    cleaned = clean_radiance(picture.rgb, picture.notes)
    plane = picture.rgb.shape[:2]
    valid = cleaned.valid if picture.valid is None else cleaned.valid & picture.valid
    clipped = np.zeros(plane, np.bool_) if picture.clipped is None else picture.clipped
    variance = np.zeros((*plane, 3), np.float32)
    if picture.variance is not None:
        known = np.isfinite(picture.variance) & (picture.variance > 0) & valid[..., None]
        variance[known] = picture.variance[known]
    radiance = np.where(valid[..., None], cleaned.radiance, np.float32(0))
    return RadianceImage(radiance, variance, valid, clipped, picture.scale), cleaned


def write_radiance(
    path: Path, image: RadianceImage, *, comments: str = "", force: bool = True
) -> None:
    """Write radiance with all its marks to an .exr file, or its colours to a .hdr file.

    `comments` are OpenEXR's attribute of that name: where the numbers come from.
    """
    write_hdr(
        path,
        image.radiance,
        valid=image.valid,
        clipped=image.clipped,
        variance=image.variance,
        scale=image.scale,
        primaries=image.primaries,
        attributes={"comments": comments} if comments else None,
        force=force,
    )


def _read_exr_picture(path: Path) -> HdrPicture:
    file = read_exr(path)
    channels = file.channels
    notes: tuple[str, ...] = ()
    if set("RGB") <= channels.keys():
        rgb = np.stack([channels[name] for name in "RGB"], axis=-1)
    elif "Y" in channels and channels.keys().isdisjoint(("R", "G", "B", "RY", "BY")):
        rgb = np.repeat(channels["Y"][..., None], 3, axis=-1)
        notes = ("luminance repeated to grey",)
    else:
        found = sorted(channels)  # shown as a list: names are the file's, and may hold anything
        raise InputError(f"{path}: wanted channels R, G and B (or Y alone), found {found}")
    scale = file.attributes.get(_SCALE, RELATIVE)
    check_scale(path, scale)
    picture = HdrPicture(
        rgb,
        valid=_mask(channels, "valid"),
        clipped=_mask(channels, "clipped"),
        variance=(
            np.stack([channels[name] for name in _VARIANCE], axis=-1)
            if channels.keys() >= set(_VARIANCE)
            else None
        ),
        scale=scale,
        notes=notes,
        attributes=file.attributes,
    )
    return _in_rec709(path, picture, file.attributes.get("chromaticities", REC709))


def _read_hdr_picture(path: Path) -> HdrPicture:
    rgb, header = read_radiance_hdr(path)
    notes = tuple(f"{name} divided out" for name in ("EXPOSURE", "COLORCORR") if name in header)
    picture = HdrPicture(rgb, notes=notes)
    if header["FORMAT"].endswith("xyze") or "PRIMARIES" not in header:
        return picture
    return _in_rec709(path, picture, header["PRIMARIES"].split())


def _mask(channels: Mapping[str, NDArray[np.float32]], name: str) -> NDArray[np.bool_] | None:
    return channels[name] > 0.5 if name in channels else None


def _in_rec709(path: Path, picture: HdrPicture, chromaticities: Sequence[Any]) -> HdrPicture:
    """Return the picture converted from these primaries (4 pairs xy), if they are others."""
    try:
        xy = np.array(chromaticities, np.float64).reshape(4, 2)
        if not xy.any():
            note = "primaries given as zeros: taken to be Rec.709"
            return replace(picture, notes=(*picture.notes, note))
        if are_rec709(xy):
            return picture
        matrix = to_rec709(xy)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: primaries that are no colours ({error})") from None
    with np.errstate(invalid="ignore", over="ignore"):
        rgb = picture.rgb @ matrix.T.astype(np.float32)
        variance = picture.variance
        if variance is not None:
            variance = variance @ (matrix**2).T.astype(np.float32)
    note = "converted to Rec.709 from the primaries that the file names"
    return replace(picture, rgb=rgb, variance=variance, notes=(*picture.notes, note))


def _is_hdr(path: Path) -> bool:
    return path.suffix.lower() == ".hdr"
