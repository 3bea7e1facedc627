"""Lenses calibrated from views of boards, ours against OpenCV's two calibrations.

Real views      : the captures in ../shared/data, where they are; the corners of
                  calibration/detection.py for every system. Every other view is fitted, the rest
                  held out, then the other way round.
Simulated views : 24 of a 9×6 board, 0.1 px of noise, to 80° from the axis of lenses of 194° and
                  220°, at places drawn anew for every repeat, and twelve draws of ten views.
`held_out_px`     : rms over the held-out corners, each with a pose fitted to the others of its view
                    by halves with the lens held, by the same code for every system;
`angle_80_mrad`   : error of directions at 80°, rms over the azimuth and the draws, after the
                    rotation that fits best;
`covered`         : share of directions whose error is within 1.96 of the standard deviations that
                    were predicted for their angle;
`succeeded`       : of the twelve draws, those whose directions are within 5 mrad to 60°.
Times           : CPU time of the calibration alone, medians.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.board import Board, parse_board
from calibration.camera import CameraModel
from calibration.detection_files import detect_views
from calibration.lens.adjust import Solution
from calibration.lens.corners import gather
from calibration.lens.fit import fit_lens
from calibration.lens.poses import Poses
from calibration.lens.quality import Quality
from calibration.lens.start import first_solution
from calibration.lens.uncertainty import Fan, direction_difference, fan
from calibration.lens.validation import predicted_residuals_px
from calibration.models.double_sphere import DoubleSphere
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.unified import Unified
from calibration.observations import View
from capture.errors import InputError
from tests.calibration.simulated_views import BOARD, simulated_views

DATA = Path(__file__).parents[2].parent / "shared/data"

REAL_SETS = {
    "Fisheye1": ("calib-urban-fisheye/Fisheye1_*.jpg", "8x6", 0.0325),
    "Fisheye2": ("calib-urban-fisheye/Fisheye2_*.jpg", "8x6", 0.117),
    "camodocal": ("calib-camodocal/*.png", "9x6", 0.1),
    "Kaidan mirror": ("calib-kaidan-catadioptric/example/*.jpg", "11x7", 0.03),
}

SIZE_PX = (1200, 1200)

SIMULATED: dict[str, CameraModel] = {
    "194°": KannalaBrandt((601.3, 597.2), 330.0, -0.02, 0.004, -0.001, 0.0),
    "220°": DoubleSphere((595.1, 603.8), 250.0, -0.15, 0.6),
}

FAN = fan((0.0, np.deg2rad(80.0)), np.deg2rad(80.0))

NO_POSES = Poses(np.empty((0, 3, 3)), np.empty((0, 3)))


class Found(NamedTuple):
    """A lens, and what its calibration says of how sure it is."""

    solution: Solution
    quality: Quality | None = None


Calibrate = Callable[[Board, list[View]], Found]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return one row per case and system: {stage, case, system, ms, ratio, accuracy}."""
    rows = []
    for name, (board, views) in real_views().items():
        rows += _compared(
            f"{name}, {len(views)} views", partial(held_out, board=board, views=views)
        )
    for name, lens in SIMULATED.items():
        rows += _compared(f"simulated {name}", partial(simulated, lens=lens, repeats=repeats))
        rows += _compared(f"simulated {name}, 10 views", partial(successes, lens=lens))
    return rows


def _compared(
    case: str, measure: Callable[[Calibrate], tuple[float, dict[str, Any]]]
) -> list[dict[str, Any]]:
    measured = {name: measure(calibrate) for name, calibrate in SYSTEMS.items()}
    own_ms = measured["fishlight"][0]
    return [
        {
            "stage": "lens",
            "case": case,
            "system": name,
            "ms": ms,
            "ratio": ms / own_ms if name != "fishlight" else None,
            "accuracy": accuracy,
        }
        for name, (ms, accuracy) in measured.items()
    ]


def real_views() -> dict[str, tuple[Board, list[View]]]:
    """Return the boards and views of the captures that are at hand."""
    found = {}
    for name, (pattern, board_name, square_m) in REAL_SETS.items():
        paths = sorted(DATA.glob(pattern), key=lambda path: (len(path.stem), path.stem))
        if paths:
            board = parse_board(board_name, square_m)
            seen = detect_views(paths, board)
            found[name] = board, [each for each in seen if isinstance(each, View)]
    return found


def held_out(calibrate: Calibrate, board: Board, views: list[View]) -> tuple[float, dict[str, Any]]:
    """Return the time of a calibration in ms and its error at the views it did not see."""
    times_ms, errors = [], []
    # Poses to begin from, the same for every system.
    every = first_solution(gather(board, views), views[0].size_px).solution.poses
    for first in (0, 1):
        fitted, rest = views[first::2], views[1 - first :: 2]
        start_s = time.process_time()
        try:
            solution = calibrate(board, fitted).solution
        except (cv2.error, InputError) as error:
            return float("nan"), {"held_out_px": f"fails: {str(error)[:40]}"}
        times_ms.append((time.process_time() - start_s) * 1e3)
        poses = every.views(np.arange(len(views))[1 - first :: 2])
        at = replace(solution, poses=poses)
        errors.append(predicted_residuals_px(gather(board, rest), at))
    return median(times_ms), {"held_out_px": _rms(np.concatenate(errors))}


def simulated(
    calibrate: Calibrate, lens: CameraModel, repeats: int
) -> tuple[float, dict[str, Any]]:
    """Return the median time in ms, and the error of directions against the truth."""
    times_ms, at_rim, inside = [], [], []
    for seed in range(repeats):
        views = _draw(lens, 24, seed)
        start_s = time.process_time()
        try:
            found = calibrate(BOARD, views)
        except (cv2.error, InputError):
            continue
        times_ms.append((time.process_time() - start_s) * 1e3)
        at_rim.append(_error_rad(found, lens, FAN)[-1])
        inside += _within_prediction(found, lens)
    if not at_rim:
        return float("nan"), {"angle_80_mrad": "fails"}
    covered = {"covered": float(np.mean(inside))} if inside else {}
    rim_mrad = 1e3 * float(np.sqrt(np.mean(np.square(at_rim))))
    return median(times_ms), {"angle_80_mrad": rim_mrad, **covered}


def successes(calibrate: Calibrate, lens: CameraModel) -> tuple[float, dict[str, Any]]:
    """Return the median time in ms, and of how many draws of ten views the lens is found."""
    times_ms, found = [], 0
    for seed in range(100, 112):
        views = _draw(lens, 10, seed)
        start_s = time.process_time()
        try:
            lens_found = calibrate(BOARD, views)
        except (cv2.error, InputError):
            continue
        times_ms.append((time.process_time() - start_s) * 1e3)
        middle = fan((0.0, np.deg2rad(60.0)), np.deg2rad(60.0))
        found += bool(np.max(_error_rad(lens_found, lens, middle)) < 5e-3)
    return median(times_ms or [float("nan")]), {"succeeded": f"{found} of 12"}


def _draw(lens: CameraModel, count: int, seed: int) -> list[View]:
    return simulated_views(lens, SIZE_PX, count, np.random.default_rng(seed))


def _within_prediction(found: Found, lens: CameraModel) -> list[bool]:
    """Return for directions at which corners were seen whether the error is as predicted."""
    quality = found.quality
    if quality is None:
        return []
    at = fan(quality.seen_rad, quality.seen_rad[1])
    sigma = np.interp(at.angle_rad, quality.angle_rad, quality.sigma_rad)
    return list((_error_rad(found, lens, at) <= 1.96 * sigma[:, None]).ravel())


def _error_rad(found: Found, lens: CameraModel, at: Fan) -> NDArray[np.float64]:
    return np.linalg.norm(direction_difference(found.solution.model, lens, at), axis=-1)


def _rms(residuals: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=-1))))


def _ours(board: Board, views: list[View]) -> Found:
    fit = fit_lens(board, views)
    return Found(fit.solution, fit.quality)


def _fisheye(board: Board, views: list[View]) -> Found:
    """OpenCV's Kannala-Brandt calibration, with the start that it needs: see its issue 23962."""
    width, height = views[0].size_px
    focal = width / np.pi
    start = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW | cv2.CALIB_USE_INTRINSIC_GUESS
    found = cv2.fisheye.calibrate(*_points(board, views), start, np.zeros((4, 1)), flags=flags)
    return _found(KannalaBrandt, found[1], (), found[2])


def _fisheye_default(board: Board, views: list[View]) -> Found:
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    points = _points(board, views)
    found = cv2.fisheye.calibrate(*points, np.eye(3), np.zeros((4, 1)), flags=flags)
    return _found(KannalaBrandt, found[1], (), found[2])


def _omnidir(board: Board, views: list[View]) -> Found:
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-8)
    found = cv2.omnidir.calibrate(
        *_points(board, views),
        np.eye(3),
        np.zeros((1, 1)),
        np.zeros((1, 4)),
        cv2.omnidir.CALIB_FIX_SKEW,
        criteria,
    )
    return _found(Unified, found[1], found[2].ravel(), found[3])


def _points(board: Board, views: list[View]) -> tuple[list[Any], list[Any], tuple[int, int]]:
    on_board = [board.points_m()[view.point_ids][None] for view in views]
    return on_board, [np.array(view.corners_px)[None] for view in views], views[0].size_px


def _found(model: Any, K: Any, shape: Any, distortion: Any) -> Found:
    centre, focal = (float(K[0, 2]), float(K[1, 2])), (float(K[0, 0]), float(K[1, 1]))
    values = [float(each) for each in [*shape, *np.ravel(distortion)[:4]]]
    return Found(Solution(model(centre, focal, *values), NO_POSES))


SYSTEMS: dict[str, Calibrate] = {
    "fishlight": _ours,
    "cv2.fisheye, f guessed": _fisheye,
    "cv2.fisheye, default": _fisheye_default,
    "cv2.omnidir": _omnidir,
}


if __name__ == "__main__":
    for row in run(6):
        print(row)
