"""Radiance in camera pixels, with what is known about each pixel."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only
from capture.errors import InputError
from capture.primaries import PrimariesName

RELATIVE = "relative"
"""Scale of radiance without an absolute calibration."""

CD_M2 = "cd/m²"
"""Scale of radiance whose luminance, 0.2126 R + 0.7152 G + 0.0722 B, is in candela per m²."""

_LONGEST_SCALE = 40  # "W·sr⁻¹·m⁻²", with room for words
_INFINITY_BITS = np.float32(np.inf).view(np.uint32)


@dataclass(frozen=True, eq=False)
class RadianceImage:
    """Linear radiance of a camera picture.

    Attributes
    ----------
    radiance : (H, W, 3) float32
        Finite and at least 0, in the unit that `scale` names; a lower bound where `clipped`.
    variance : (H, W, 3) float32
        Variance of `radiance` from photon, read and quantisation noise; 0 where it is unknown.
    valid : (H, W) bool
        False where the pixel holds no measurement; its radiance is then 0.
    clipped : (H, W) bool
        True where even the shortest exposure was full in some channel.
    scale : str
        "relative", or the unit after an absolute calibration.
    primaries : "rec709", "rec2020" or "acescg"
        Every stage takes Rec.709; others are for other programs.
    """

    radiance: NDArray[np.float32]
    variance: NDArray[np.float32]
    valid: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    scale: str = RELATIVE
    primaries: PrimariesName = "rec709"

    def __post_init__(self) -> None:
        radiance = read_only("radiance", self.radiance, np.float32, (None, None, 3))
        plane = radiance.shape[:2]
        object.__setattr__(self, "radiance", radiance)
        object.__setattr__(
            self, "variance", read_only("variance", self.variance, np.float32, (*plane, 3))
        )
        for name in ("valid", "clipped"):
            mask = read_only(name, getattr(self, name), np.bool_, plane)
            object.__setattr__(self, name, mask)
        check_radiance(radiance)

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height)."""
        return self.radiance.shape[1], self.radiance.shape[0]


def check_scale(path: Path, scale: object) -> None:
    """Raise InputError unless what a file says of its scale is the name of a unit."""
    if not (isinstance(scale, str) and scale.isprintable() and 0 < len(scale) <= _LONGEST_SCALE):
        raise InputError(f"{path}: its scale is {str(scale)[:_LONGEST_SCALE]!r}; wanted a unit")


def check_radiance(radiance: NDArray[np.float32]) -> None:
    """Raise ValueError unless all values are finite and at least 0."""
    # Bits of these are less than those of infinity, NaN and negative numbers (but −0 is allowed):
    # one pass in place of two.
    if radiance.view(np.uint32).max(initial=0) < _INFINITY_BITS:
        return
    if not (radiance.min() >= 0 and np.isfinite(radiance.max())):
        raise ValueError("radiance must be finite and at least 0; clean_radiance() sees to it")


@dataclass(frozen=True, eq=False)
class Cleaned:
    """Radiance fit for use, and how much of it was not.

    `radiance` has zeros where `valid` is False (NaN or infinite) and where it was negative. `notes`
    say, for people, what was done to it before, when its file was read.
    """

    radiance: NDArray[np.float32]
    valid: NDArray[np.bool_]
    nan_count: int
    infinite_count: int
    negative_count: int
    notes: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of it, a line each: the notes, and what was removed."""
        removed = str(self)
        return (*self.notes, f"set to 0 in the file: {removed} values") if removed else self.notes

    def refuse(self, path: Path) -> None:
        """Raise InputError if anything had to be removed from the file at `path`."""
        removed = str(self)
        if removed:
            raise InputError(f"{path} holds {removed} values; without --strict they are set to 0")

    def __str__(self) -> str:
        parts = [
            f"{count} {kind}"
            for count, kind in (
                (self.nan_count, "NaN"),
                (self.infinite_count, "infinite"),
                (self.negative_count, "negative"),
            )
            if count
        ]
        return ", ".join(parts)


def clean_radiance(radiance: NDArray[np.floating], notes: tuple[str, ...] = ()) -> Cleaned:
    """Return radiance without NaN, infinities and negative values, and count what was removed.

    Parameters
    ----------
    radiance : (H, W, 3) float
    notes : tuple of str
        What was done to it before, to be passed on.

    Returns
    -------
    Cleaned
        A pixel with a NaN or infinite channel is 0 and not valid. A negative channel (the ringing
        of a resampling filter, or black subtracted from noise) is set to 0 and stays valid.
        Counts are of channel values.
    """
    nan = np.isnan(radiance)
    infinite = np.isinf(radiance)
    valid = ~(nan | infinite).any(axis=-1)
    negative = (radiance < 0) & valid[..., None]
    with np.errstate(over="ignore"):  # a float64 value may be infinite in float32
        clean = np.where(negative | ~valid[..., None], 0, radiance).astype(np.float32)
    overflow = np.isinf(clean)
    if overflow.any():
        infinite |= overflow
        valid &= ~overflow.any(axis=-1)
        clean[~valid] = 0
    return Cleaned(clean, valid, int(nan.sum()), int(infinite.sum()), int(negative.sum()), notes)
