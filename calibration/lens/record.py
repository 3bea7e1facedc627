"""What a lens was calibrated from and how well, as its calibration file keeps it.

Input  : the key "lens_fit" of a calibration file.    Output : LensRecord, from which the views can
be fitted again, the residuals drawn, and the quality told without the pictures.
"""

from pathlib import Path

import msgspec
import numpy as np

from calibration.board import Board
from calibration.camera import Calibration
from calibration.files import read_record
from calibration.lens.adjust import Solution
from calibration.lens.choice import Trial
from calibration.lens.corners import WARP_DEGREES, Corners, gather
from calibration.lens.fit import LensFit
from calibration.lens.poses import Poses
from calibration.observations import Rejected, View
from capture.errors import InputError

_CORNER_DIGITS = 4
"""Of corners in pixels: a ten-thousandth of one is far below what any picture tells."""

_FEW_VIEWS = 10

_Row = tuple[float, float, float]


class ViewRecord(msgspec.Struct, frozen=True):
    """A view that was used: its corners, which of them were kept, and the board's pose."""

    name: str
    point_ids: list[int]
    corners_px: list[tuple[float, float]]
    corner_sigma_px: list[float]
    kept: list[bool]
    R_camera_board: tuple[_Row, _Row, _Row]
    t_camera_board_m: _Row


class TrialRecord(msgspec.Struct, frozen=True):
    """A lens that was tried, as in `calibration.lens.choice.Trial`."""

    model: str
    parameter_count: int
    held_out_px: float
    excess_px: float
    excess_error_px: float


class LensRecord(msgspec.Struct, frozen=True):
    """What a lens was calibrated from and how well, as in `calibration.lens.fit.LensFit`.

    Where `sigma_rad` is None there is no direction, where `split_rad` is None no comparison.
    """

    board: Board
    views: list[ViewRecord]
    rejected: list[Rejected]
    warp_m: list[float]
    pupil_m: float
    sigma_px: float
    rms_px: float
    trials: list[TrialRecord]
    chosen: str
    angle_rad: list[float]
    sigma_rad: list[float | None]
    split_rad: list[float | None]
    seen_rad: tuple[float, float]


def record_of(fit: LensFit) -> LensRecord:
    """Return what the calibration file keeps of a fit."""
    solution, quality = fit.solution, fit.quality
    starts = np.cumsum([0, *(len(view) for view in fit.views)])
    views = [
        ViewRecord(
            view.name,
            view.point_ids.tolist(),
            view.corners_px.round(_CORNER_DIGITS).tolist(),
            view.corner_sigma_px.round(_CORNER_DIGITS + 1).tolist(),
            fit.kept[starts[i] : starts[i + 1]].tolist(),
            solution.poses.R_camera_board[i].tolist(),
            tuple(solution.poses.t_camera_board_m[i].tolist()),
        )
        for i, view in enumerate(fit.views)
    ]
    return LensRecord(
        fit.board,
        views,
        list(fit.rejected),
        solution.warp_m.tolist(),
        solution.pupil_m,
        fit.sigma_px,
        fit.chosen.fit.rms_px,
        [_trial_record(trial) for trial in fit.trials],
        fit.chosen.candidate.label,
        quality.angle_rad.tolist(),
        quality.sigma_rad.tolist(),
        quality.split_rad.tolist(),
        quality.seen_rad,
    )


def read_lens_record(path: Path) -> LensRecord:
    """Return what a calibration file keeps of its making.

    Raises
    ------
    InputError
        If the file cannot be read, was not made by `fishlight calibrate lens`, or has lost a part
        of what that wrote.
    """
    record = read_record(path, "lens_fit", LensRecord)
    if record is None:
        raise InputError(f"{path} keeps no views: it was not made by fishlight calibrate lens")
    try:
        check_record(record)
    except InputError as error:
        raise InputError(f"{path}: lens_fit: {error}") from None
    return record


def check_record(record: LensRecord) -> None:
    """Raise InputError unless the parts belong together, as they do when they are written."""
    points = len(record.board.points_m())
    for view in record.views:
        ids = view.point_ids
        lists = (ids, view.corners_px, view.corner_sigma_px, view.kept)
        rising = bool(np.all(np.diff(ids) > 0))
        if len({len(each) for each in lists}) > 1 or not ids or not rising:
            raise InputError(f"{view.name}: its corners and their numbers do not match")
        if ids[0] < 0 or ids[-1] >= points:
            raise InputError(f"{view.name}: the board has points 0 to {points - 1}")
        if not min(view.corner_sigma_px) > 0:
            raise InputError(f"{view.name}: corner_sigma_px must be positive")
    if not any(True in view.kept for view in record.views):
        raise InputError("there is no corner")
    if len(record.warp_m) != len(WARP_DEGREES):
        raise InputError(f"warp_m must have {len(WARP_DEGREES)} lengths")
    if record.chosen not in [trial.model for trial in record.trials]:
        raise InputError(f"{record.chosen!r} is chosen, but was not tried")
    curves = (record.angle_rad, record.sigma_rad, record.split_rad)
    if len({len(curve) for curve in curves}) > 1 or len(record.angle_rad) < 2:
        raise InputError("angle_rad, sigma_rad and split_rad must be equally long")


def restored(record: LensRecord, calibration: Calibration) -> tuple[Corners, Solution]:
    """Return the corners and the solution of the calibration they belong to."""
    views = [
        View(
            view.name,
            calibration.image_size_px,
            np.array(view.point_ids, np.int64),
            np.array(view.corners_px),
            np.array(view.corner_sigma_px),
        )
        for view in record.views
    ]
    poses = Poses(
        np.array([view.R_camera_board for view in record.views]),
        np.array([view.t_camera_board_m for view in record.views]),
    )
    solution = Solution(calibration.model, poses, np.array(record.warp_m), record.pupil_m)
    return gather(record.board, views), solution


def summary(record: LensRecord, calibration: Calibration) -> list[str]:
    """Return the short form of how good the calibration is, a sentence a line."""
    tried = {trial.model: trial for trial in record.trials}
    taken = tried[record.chosen]
    best = min(record.trials, key=lambda trial: trial.held_out_px)
    inner, outer = np.rad2deg(record.seen_rad)
    corners = sum(len(view.kept) for view in record.views)
    wrong = corners - sum(sum(view.kept) for view in record.views)
    lines = [
        f"{len(record.views)} of {len(record.views) + len(record.rejected)} pictures used, "
        f"{corners} corners, {wrong} of them left out as wrong",
        *(f"not used: {each.name}: {each.reason}" for each in record.rejected),
        f"{taken.model}: {taken.parameter_count} numbers, {taken.held_out_px:.3f} px rms at "
        f"corners it was not fitted to ({record.rms_px:.3f} where fitted); the simplest of "
        f"{len(tried)} lenses that is not worse than {best.model} ({best.held_out_px:.3f} px)",
        f"directions are sure to {_listed(record.angle_rad, record.sigma_rad, record.seen_rad)} "
        "(standard deviation)",
        "lenses from every other view differ by "
        f"{_listed(record.angle_rad, record.split_rad, record.seen_rad)}",
        f"corners were seen from {inner:.0f}° to {outer:.1f}° off the axis; "
        f"rays are taken {_from(calibration)}to {np.rad2deg(calibration.valid_angle_rad):.1f}°",
    ]
    if len(record.views) < _FEW_VIEWS:
        lines.append(f"{len(record.views)} views are few: ten or more tell more than their noise")
    return lines


def _from(calibration: Calibration) -> str:
    inner = np.rad2deg(calibration.inner_angle_rad)
    return f"from {inner:.1f}° " if inner else ""


def _listed(
    angle_rad: list[float], value_rad: list[float | None], seen_rad: tuple[float, float]
) -> str:
    """Return values in mrad at a few angles of those seen."""
    inner, outer = seen_rad
    at = [angle for angle in np.deg2rad([15, 30, 45, 60, 75, 90, 105]) if inner < angle < outer]
    values = [np.nan if each is None else each for each in value_rad]
    parts = [
        f"{np.interp(angle, angle_rad, values) * 1e3:.2f} mrad at {np.rad2deg(angle):.0f}°"
        for angle in [*at[1::2], outer]
    ]
    return ", ".join(parts)


def _trial_record(trial: Trial) -> TrialRecord:
    return TrialRecord(
        trial.candidate.label,
        trial.parameter_count,
        trial.held_out_px,
        trial.excess_px,
        trial.excess_error_px,
    )
