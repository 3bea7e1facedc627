"""Lenses calibrated from views of boards, ours against OpenCV's calibrations and the possible.

Real views      : the captures in ../shared/data, where they are; the corners of
                  calibration/detection.py for every system. Every other view is fitted, the rest
                  held out, then the other way round; and twelve random subsets of ten views.
Simulated views : 24 of a 9×6 board, 0.1 px of noise, to 80° from the axis of lenses of 194° and
                  220°, and of an 8×6 board that fills more of the picture to 97°, at places drawn
                  anew for every repeat; and twelve draws of ten views.
`held_out_px`   : rms over the held-out corners, each with a pose fitted to the others of its view
                  by halves with the lens held, by the same code for every system. "held-out views
                  fitted too" is what no lens of its kind can be much below: the views' own faults;
`error_px`, `rim_px`, `rim_mrad` : errors against the truth, rms over the draws, after the rotation
                  that fits best: over the solid angle to the rim, 80° or 97°, and at it. The
                  "information bound" is what corners of that noise leave possible to an unbiased
                  estimate of all parameters of the true lens; a simpler lens may be below it;
`covered`       : share of directions whose error is within 1.96 of the standard deviations that
                  were predicted for their angle, where corners were seen. Errors of one draw go
                  together: of 24 draws it is known to 0.03;
`calibrated`    : of the draws, those that raised no exception; the errors are of these alone;
`succeeded`     : of the twelve, those whose directions are within 10 mrad of the truth, or of the
                  lens of all views, to 60°, or 85 % of what was seen; `refused`: with a reason.
Times           : CPU time of the calibration alone, medians.
Command         : python -m tests.benchmarks.lens, some ten minutes; no stage of `make bench`.
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
from calibration.lens.adjust import Free, Solution, adjust
from calibration.lens.corners import gather
from calibration.lens.fit import fit_lens
from calibration.lens.poses import poses_from_directions
from calibration.lens.quality import Quality
from calibration.lens.start import first_solution
from calibration.lens.uncertainty import Fan, direction_covariance, direction_difference, fan
from calibration.lens.validation import predicted_residuals_px
from calibration.models.parameters import parameters
from calibration.observations import View
from capture.errors import InputError
from tests.benchmarks import lens_peers
from tests.benchmarks.lens_scenes import NOISE_PX, SIMULATED, Scene

Array = NDArray[np.float64]

DATA = Path(__file__).parents[2].parent / "shared/data"

REAL_SETS = {
    "Fisheye1": ("calib-urban-fisheye/Fisheye1_*.jpg", "8x6", 0.0325),
    "Fisheye2": ("calib-urban-fisheye/Fisheye2_*.jpg", "8x6", 0.117),
    "camodocal": ("calib-camodocal/*.png", "9x6", 0.1),
    "Kaidan mirror": ("calib-kaidan-catadioptric/example/*.jpg", "11x7", 0.03),
}

VIEWS = 24


class Found(NamedTuple):
    """A lens, and what its calibration says of how sure it is."""

    solution: Solution
    quality: Quality | None = None


Calibrate = Callable[[Board, list[View]], Found]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return one row per case and system: {stage, case, system, ms, ratio, accuracy}."""
    rows = []
    for name, (board, views) in real_views().items():
        case = f"{name}, {len(views)} views"
        rows += _compared(case, partial(held_out, board=board, views=views))
        rows.append(_row(case, "held-out views fitted too", _floor(board, views)))
        ten = partial(subsets, board=board, views=views)
        rows += _compared(f"{name}, 10 views of them", ten)
    for name, scene in SIMULATED.items():
        rows += _compared(f"simulated {name}", partial(simulated, scene=scene, repeats=repeats))
        rows.append(_row(f"simulated {name}", "information bound", bound(scene, repeats)))
        rows += _compared(f"simulated {name}, 10 views", partial(successes, scene=scene))
    return rows


def _compared(
    case: str, measure: Callable[[Calibrate], tuple[float, dict[str, Any]]]
) -> list[dict[str, Any]]:
    measured = {name: measure(calibrate) for name, calibrate in SYSTEMS.items()}
    own_ms = measured["fishlight"][0]
    return [
        _row(case, name, accuracy, ms, ms / own_ms if name != "fishlight" else None)
        for name, (ms, accuracy) in measured.items()
    ]


def _row(
    case: str,
    system: str,
    accuracy: dict[str, Any],
    ms: float | None = None,
    ratio: float | None = None,
) -> dict[str, Any]:
    return {
        "stage": "lens",
        "case": case,
        "system": system,
        "ms": ms,
        "ratio": ratio,
        "accuracy": accuracy,
    }


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


def _floor(board: Board, views: list[View]) -> dict[str, Any]:
    """Return the error that is left with a lens fitted to all views, the held-out ones too."""
    solution = _ours(board, views).solution
    poses = first_solution(gather(board, views), views[0].size_px).solution.poses
    residuals = predicted_residuals_px(gather(board, views), replace(solution, poses=poses))
    return {"held_out_px": _rms(residuals)}


def subsets(calibrate: Calibrate, board: Board, views: list[View]) -> tuple[float, dict[str, Any]]:
    """Return the median time in ms, and how often ten of the views give the lens of all."""
    every = fit_lens(board, views)
    draws = [
        [views[i] for i in np.sort(np.random.default_rng(seed).permutation(len(views))[:10])]
        for seed in range(12)
    ]
    return _succeeded(calibrate, board, draws, every.calibration.model, every.quality.seen_rad)


def successes(calibrate: Calibrate, scene: Scene) -> tuple[float, dict[str, Any]]:
    """Return the median time in ms, and of how many draws of ten views the lens is found."""
    draws = [scene.views(10, seed) for seed in range(100, 112)]
    return _succeeded(calibrate, scene.board, draws, scene.lens, (0.0, scene.rim_rad))


def _succeeded(
    calibrate: Calibrate,
    board: Board,
    draws: list[list[View]],
    truth: CameraModel,
    seen_rad: tuple[float, float],
) -> tuple[float, dict[str, Any]]:
    times_ms, found, refused = [], 0, 0
    inner, outer = seen_rad
    ring_alone = inner > 0.5
    last = 0.85 * outer if ring_alone else np.deg2rad(60.0)
    at = fan((inner, last), last)
    judged = at.angle_rad >= inner
    for views in draws:
        start_s = time.process_time()
        try:
            lens = calibrate(board, views)
        except InputError:
            refused += 1
            continue
        except cv2.error:
            continue
        times_ms.append((time.process_time() - start_s) * 1e3)
        error = np.linalg.norm(direction_difference(lens.solution.model, truth, at), axis=-1)
        found += bool(np.max(error[judged]) < 10e-3)
    words = f"{found} of {len(draws)}"
    return median(times_ms or [float("nan")]), {"succeeded": words, "refused": refused}


def simulated(calibrate: Calibrate, scene: Scene, repeats: int) -> tuple[float, dict[str, Any]]:
    """Return the median time in ms, and the errors against the truth."""
    at = fan((0.0, scene.rim_rad), scene.rim_rad)
    times_ms, squares, inside = [], [], []
    for seed in range(repeats):
        views = scene.views(VIEWS, seed)
        start_s = time.process_time()
        try:
            found = calibrate(scene.board, views)
        except (cv2.error, InputError):
            continue
        times_ms.append((time.process_time() - start_s) * 1e3)
        error = direction_difference(found.solution.model, scene.lens, at)
        squares.append(error[..., :, None] * error[..., None, :])
        inside += _within_prediction(found, scene.lens)
    if not squares:
        return float("nan"), {"rim_mrad": "fails"}
    covered = {"covered": float(np.mean(inside))} if inside else {}
    made = {"calibrated": f"{len(squares)} of {repeats}"}
    return median(times_ms), {**_figures(squares, scene, at), **covered, **made}


def bound(scene: Scene, repeats: int) -> dict[str, Any]:
    """Return the least errors of an unbiased estimate of the true lens, from the same views."""
    at = fan((0.0, scene.rim_rad), scene.rim_rad)
    every = np.ones(len(parameters(scene.lens)), np.bool_)
    covariances = []
    for seed in range(repeats):
        corners = gather(scene.board, scene.views(VIEWS, seed))
        poses, _ = poses_from_directions(corners, *scene.lens.unproject(corners.pixels))
        posed = adjust(corners, Solution(scene.lens, poses), Free(~every)).solution
        information = adjust(corners, posed, Free(every), most_steps=0).information.sum(axis=0)
        covariance = NOISE_PX**2 * np.linalg.inv(information)
        covariances.append(direction_covariance(scene.lens, every, covariance, at))
    return _figures(covariances, scene, at)


def _figures(squares: list[Array], scene: Scene, at: Fan) -> dict[str, Any]:
    """Return rms errors of directions whose squares (A, 16, 2, 2) along the tangents are given."""
    square = np.mean(squares, axis=0)
    by_tangent = scene.lens.project_jacobian(at.directions)[0] @ at.tangents
    in_px = by_tangent @ square @ np.swapaxes(by_tangent, -1, -2)
    rad, px = (np.trace(each, axis1=-2, axis2=-1) for each in (square, in_px))
    return {
        "error_px": float(np.sqrt(np.average(px, weights=at.weight))),
        "rim_px": float(np.sqrt(px[-1].mean())),
        "rim_mrad": 1e3 * float(np.sqrt(rad[-1].mean())),
    }


def _within_prediction(found: Found, lens: CameraModel) -> list[bool]:
    """Return for directions at which corners were seen whether the error is as predicted."""
    quality = found.quality
    if quality is None:
        return []
    at = fan(quality.seen_rad, quality.seen_rad[1])
    sigma = np.interp(at.angle_rad, quality.angle_rad, quality.sigma_rad)
    error = np.linalg.norm(direction_difference(found.solution.model, lens, at), axis=-1)
    return list((error <= 1.96 * sigma[:, None]).ravel())


def _rms(residuals: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=-1))))


def _ours(board: Board, views: list[View]) -> Found:
    fit = fit_lens(board, views)
    return Found(fit.solution, fit.quality)


SYSTEMS: dict[str, Calibrate] = {
    "fishlight": _ours,
    "cv2.fisheye, f guessed": lambda board, views: Found(lens_peers.fisheye(board, views)),
    "cv2.fisheye, default": lambda board, views: Found(lens_peers.fisheye_default(board, views)),
    "cv2.omnidir": lambda board, views: Found(lens_peers.omnidir(board, views)),
}


if __name__ == "__main__":
    for row in run(24):
        print(row, flush=True)
