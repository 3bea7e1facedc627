"""Records of lens calibrations whose lens, poses and errors are known, without fitting any."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.camera import Calibration
from calibration.lens.record import LensRecord, TrialRecord, ViewRecord
from calibration.models.equidistant import Equidistant
from calibration.observations import Rejected

BOARD = Board("checkerboard", 5, 4, 0.05)

SIZE_PX = (320, 240)

LENS = Equidistant((159.5, 119.5), 80.0)
"""Sees 86° at the middle of the upper edge, and 114° at the middle of the right one."""


def facing(
    angle_deg: float, azimuth_deg: float, tilt_deg: float = 25.0, distance_m: float = 0.4
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return R and t of a board whose middle stands at an angle from the axis and an azimuth."""
    angle, azimuth, tilt = np.deg2rad((angle_deg, azimuth_deg, tilt_deg))
    sine, cosine = np.sin(angle), np.cos(angle)
    towards = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    straight = np.stack([across, np.cross(towards, across), towards], axis=-1)
    sine, cosine = np.sin(tilt), np.cos(tilt)
    R = straight @ np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    return R, distance_m * towards - R @ BOARD.points_m().mean(axis=0)


def known_record(
    places_deg: Sequence[tuple[float, float]],
    *,
    names: Sequence[str] = (),
    noise_px: float = 0.1,
    rejected: Sequence[Rejected] = (),
    last_angle_rad: float = 1.9,
) -> tuple[LensRecord, Calibration, NDArray[np.float64]]:
    """Return a record, its calibration and the errors (N, 2) of the corners.

    A board stands at each angle from the axis and azimuth. The first view's first corner is off by
    (9, 0) px and left out as wrong.
    """
    random = np.random.default_rng(4)
    points = BOARD.points_m()
    views, errors, angles = [], [], []
    for number, (angle_deg, azimuth_deg) in enumerate(places_deg):
        R, t = facing(angle_deg, azimuth_deg)
        in_camera = points @ R.T + t
        angles.append(np.arctan2(np.hypot(*in_camera.T[:2]), in_camera[:, 2]))
        error = noise_px * random.normal(size=(len(points), 2))
        kept = [True] * len(points)
        if number == 0:
            error[0], kept[0] = (9.0, 0.0), False
        errors.append(error)
        views.append(
            ViewRecord(
                names[number] if names else f"view {number}.png",
                list(range(len(points))),
                (LENS.project(in_camera)[0] + error).tolist(),
                [noise_px] * len(points),
                kept,
                R.tolist(),
                tuple(t.tolist()),
            )
        )
    angle_rad = np.linspace(0.0, last_angle_rad, 39)[1:]
    outer = float(np.max(angles))
    record = LensRecord(
        BOARD,
        views,
        list(rejected),
        [0.0] * 12,
        0.0,
        noise_px,
        float(np.sqrt(np.mean(np.sum(np.concatenate(errors)[1:] ** 2, axis=-1)))),
        [
            TrialRecord("equidistant", 3, 0.1513, 0.0012, 0.0034),
            TrialRecord("equisolid", 3, 0.9312, 0.7771, 0.0123),
            TrialRecord("kannala_brandt", 7, 0.1498, 0.0, 0.0),
        ],
        "equidistant",
        angle_rad.tolist(),
        [float(1e-3 * angle) if angle < 1.7 else None for angle in angle_rad],
        [float(2e-3 * angle) if angle < 1.7 else None for angle in angle_rad],
        (float(np.min(angles)), outer),
    )
    return record, Calibration(LENS, SIZE_PX, outer), np.concatenate(errors)


ALL_AROUND = [
    (0.0, 0.0),
    *((30.0, azimuth) for azimuth in range(0, 360, 45)),
    *((55.0, azimuth) for azimuth in range(0, 360, 30)),
]
"""Places of boards that leave no part within some 60° bare."""
