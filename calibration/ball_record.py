"""What a mirror ball was calibrated from and how well it is known, as its file keeps it.

Output : the key "ball_fit" of a calibration file.
"""

import msgspec
import numpy as np

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


def ball_record(fit: BallFit, picture: str) -> BallRecord:
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
