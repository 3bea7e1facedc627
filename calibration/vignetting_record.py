"""What a vignetting was estimated from and how well it is known, as its calibration file keeps it.

Output : the key "vignetting_fit" of a calibration file.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from calibration.camera import Calibration
from calibration.files import read_record

if TYPE_CHECKING:
    from calibration.vignetting import VignettingFit

_ANGLES = 31
_AZIMUTHS_RAD = np.linspace(0, 2 * np.pi, 8, endpoint=False)


class VignettingTrial(msgspec.Struct, frozen=True):
    """A form that was tried, as in `calibration.vignetting.Trial`."""

    radial_count: int
    uneven_count: int
    held_out: float
    is_plausible: bool


class VignettingRecord(msgspec.Struct, frozen=True):
    """Where a vignetting comes from, and its standard deviation `sigma` at `angle_rad`.

    `sigma` is of V(θ), which is 1 on the axis, and the largest around it.
    """

    source: str
    pictures: list[str]
    sample_count: int
    seen_rad: tuple[float, float]
    held_out: float
    trials: list[VignettingTrial]
    angle_rad: list[float]
    sigma: list[float]

    def __post_init__(self) -> None:
        """Raise ValueError, which msgspec tells of, if there is no standard deviation."""
        if not 0 < len(self.angle_rad) == len(self.sigma):
            raise ValueError("wanted as many of sigma as of angle_rad")


def vignetting_record(
    fit: "VignettingFit", calibration: Calibration, source: str, pictures: Sequence[str]
) -> VignettingRecord:
    """Return what the calibration file keeps of a fit."""
    limit = min(calibration.valid_angle_rad, calibration.model.limit_angle_rad)
    angle = np.linspace(0.0, limit, _ANGLES)
    sigma = fit.deviation(angle[:, None], _AZIMUTHS_RAD).max(axis=1)
    return VignettingRecord(
        source=source,
        pictures=list(pictures),
        sample_count=fit.sample_count,
        seen_rad=fit.seen_rad,
        held_out=fit.chosen.held_out,
        trials=[
            VignettingTrial(len(each.radial), len(each.uneven), each.held_out, each.is_plausible)
            for each in fit.trials
        ],
        angle_rad=angle.tolist(),
        sigma=sigma.tolist(),
    )


def read_vignetting_record(path: Path) -> VignettingRecord | None:
    """Return what the calibration file at `path` keeps of its vignetting; None if nothing.

    Raises
    ------
    InputError
        If what the file keeps was altered.
    """
    return read_record(path, "vignetting_fit", VignettingRecord)


def correction_error(record: VignettingRecord, calibration: Calibration) -> tuple[float, float]:
    """Return the relative standard deviation of radiance that vignetting was divided out of.

    Where it is largest, and that angle in rad.
    """
    angle, sigma = np.array(record.angle_rad), np.array(record.sigma)
    relative = sigma / calibration.relative_illumination(angle)
    worst = int(np.argmax(relative))
    return float(relative[worst]), float(angle[worst])


def vignetting_summary(record: VignettingRecord, calibration: Calibration) -> list[str]:
    """Return how well the vignetting is known, a sentence a line."""
    error, at_rad = correction_error(record, calibration)
    inner, outer = np.degrees(record.seen_rad)
    rim = calibration.relative_illumination(np.array(record.seen_rad[1]))
    return [
        f"vignetting from {len(record.pictures)} pictures ({record.source}), "
        f"{record.sample_count} samples from {inner:.0f}° to {outer:.1f}° off the axis, "
        f"where the lens passes {float(rim):.1%} of what it does on the axis",
        f"samples it was not fitted to are off by {record.held_out:.2%} rms; corrected radiance is "
        f"sure to {error:.2%} or better (standard deviation; worst at {np.degrees(at_rad):.0f}°)",
    ]
