"""What a vignetting was estimated from and how well it is known, as its calibration file keeps it.

Output : the key "vignetting_fit" of a calibration file.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from calibration.camera import Calibration
from calibration.files import read_records
from capture.errors import InputError

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


def correction_error(path: Path, calibration: Calibration) -> tuple[float, float] | None:
    """Return the relative standard deviation of radiance that vignetting was divided out of.

    Where it is largest, and that angle in rad; None if the calibration's file at `path` does not
    tell how well its vignetting is known.

    Raises
    ------
    InputError
        If what the file keeps was altered.
    """
    content = read_records(path).get("vignetting_fit")
    if content is None:
        return None
    try:
        record = msgspec.convert(content, VignettingRecord)
        angle, sigma = np.array(record.angle_rad), np.array(record.sigma)
        relative = sigma / calibration.relative_illumination(angle)
        worst = int(np.argmax(relative))
        return float(relative[worst]), float(angle[worst])
    except (msgspec.ValidationError, ValueError) as error:
        raise InputError(f"{path}: vignetting_fit: {error}") from None
