"""What a mirror ball was calibrated from and how well it is known, as its file keeps it.

Output : the key "ball_fit" of a calibration file.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from calibration.files import read_record

if TYPE_CHECKING:
    from calibration.ball import BallFit

_ANGLES = 46


class BallRecord(msgspec.Struct, frozen=True):
    """An outline as in `calibration.ball_outline.Outline`, and what it leaves open.

    `sigma_rad` is the standard deviation of directions at `angle_rad` from the direction back to
    the camera.
    """

    picture: str
    centre_px: tuple[float, float]
    half_angle_rad: float
    covariance: list[list[float]]
    residual_px: float
    support: float
    angle_rad: list[float]
    sigma_rad: list[float]

    def __post_init__(self) -> None:
        """Raise ValueError, which msgspec tells of, if there is no standard deviation."""
        if not 0 < len(self.angle_rad) == len(self.sigma_rad):
            raise ValueError("wanted as many of sigma_rad as of angle_rad")


def ball_record(fit: "BallFit", picture: str) -> BallRecord:
    """Return what the calibration file keeps of a fit to the picture of this name."""
    outline = fit.outline
    angle_rad = np.linspace(fit.angles_rad[0], fit.angles_rad[-1], _ANGLES)
    return BallRecord(
        picture=picture,
        centre_px=outline.centre_px,
        half_angle_rad=outline.half_angle_rad,
        covariance=outline.covariance.tolist(),
        residual_px=outline.residual_px,
        support=outline.support,
        angle_rad=angle_rad.tolist(),
        sigma_rad=np.interp(angle_rad, fit.angles_rad, fit.deviation_rad).tolist(),
    )


def read_ball_record(path: Path) -> BallRecord | None:
    """Return what the calibration file at `path` keeps of its mirror ball; None if nothing.

    Raises
    ------
    InputError
        If what the file keeps was altered.
    """
    return read_record(path, "ball_fit", BallRecord)


def ball_summary(record: BallRecord) -> list[str]:
    """Return how well the ball is known, a sentence a line."""
    x, y = record.centre_px
    by = f"{record.support:.0%} of it seen" if record.support > 0 else "marked by hand"
    angle, sigma = np.degrees(record.angle_rad), np.degrees(record.sigma_rad)
    shown = [len(angle) // 2, len(angle) - 1]
    return [
        f"mirror ball in {record.picture} at {x:.2f}, {y:.2f} px: outline {by}, "
        f"{record.residual_px:.2f} px rms off it",
        "directions are sure to "
        + ", ".join(f"{sigma[index]:.2f}° at {angle[index]:.0f}°" for index in shown)
        + " from the direction back to the camera (standard deviation)",
    ]
