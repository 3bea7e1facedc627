"""What the corners of a calibration tell, taken from its file alone.

Input  : LensRecord and Calibration of one file.    Output : Evidence, from which all is drawn.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.lens.adjust import in_camera_m, residuals_px
from calibration.lens.corners import Corners, gather
from calibration.lens.record import LensRecord, restored
from calibration.observations import View

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The corners of V views, N in all, and what the lens makes of them.

    Attributes
    ----------
    record : LensRecord
    calibration : Calibration
    corners : Corners
    kept : (N,) bool
        False for the corners that were left out as wrong.
    residuals_px : (N, 2) float64
        Projected less found.
    outward_px : (N,) float64
        The residuals' part away from where the axis meets the picture.
    angle_rad, azimuth_rad : (N,) float64
        Of the board's point, from the camera's +z and, around it, from +x towards +y.
    boards_px : (V, P, 2) float64
        Where the lens sees each of the board's points, found or not; NaN where it has no pixel.
    """

    record: LensRecord
    calibration: Calibration
    corners: Corners
    kept: NDArray[np.bool_]
    residuals_px: Array
    outward_px: Array
    angle_rad: Array
    azimuth_rad: Array
    boards_px: Array

    def rms_px(self, view: int) -> float:
        """Return the rms length of a view's kept residuals; NaN without any."""
        part = self.corners.of_view(view)
        kept = self.residuals_px[part][self.kept[part]]
        return float(np.sqrt(np.mean(np.sum(kept**2, axis=-1)))) if len(kept) else np.nan

    def tilt_rad(self, view: int) -> float:
        """Return the angle between a view's board and the sensor."""
        into = abs(self.record.views[view].R_camera_board[2][2])
        return float(np.arccos(np.clip(into, 0.0, 1.0)))


def evidence_of(record: LensRecord, calibration: Calibration) -> Evidence:
    """Return the corners of a calibration with their residuals and angles."""
    corners, solution = restored(record, calibration)
    residuals = residuals_px(corners, solution)
    x, y, z = in_camera_m(corners, solution).T
    middle, _ = calibration.model.project(np.array([0.0, 0.0, 1.0]))
    outward = corners.pixels - middle
    outward /= np.maximum(np.hypot(*outward.T), np.finfo(np.float64).tiny)[:, None]

    count = len(record.board.points_m())
    # Found at 0, a point's residual is where it is projected to.
    blank = View(
        "", calibration.image_size_px, np.arange(count), np.zeros((count, 2)), np.ones(count)
    )
    every = gather(record.board, [blank] * len(record.views))
    return Evidence(
        record,
        calibration,
        corners,
        np.array([kept for view in record.views for kept in view.kept]),
        residuals,
        np.sum(residuals * outward, axis=-1),
        np.arctan2(np.hypot(x, y), z),
        np.arctan2(y, x),
        residuals_px(every, solution).reshape(-1, count, 2),
    )
