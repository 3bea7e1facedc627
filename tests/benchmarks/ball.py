"""Directions that a mirror ball shows, against those that a ray tracer sent there.

Pictures : ray-traced balls of 210 and 420 px radius at D/R = 5, 10 and 20, on the camera's axis and
           17° off it, in a room, with noise of 1 %; see tests/calibration/ball_pictures.py.
Times    : of finding the outline and the calibration, medians over the pictures.
           Without its focal length only those on the axis: others are refused.
Accuracy : medians over the pictures of a D/R; angles are from the direction back to the camera:
`deg_95`    : 95 % of pixels up to 90° are off by less, in degrees;
`deg_95_at_150` : the same of pixels from 90° to 150°;
`worst_deg` : the most any of all valid pixels is off by;
`valid_deg` : up to where directions are valid;
`covered`   : share of all valid pixels that are off by less than twice what was predicted.
"""

import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.ball import ASSUMED_RATIO, BallFit, fit_ball
from calibration.ball_cone import Pinhole, distant_pinhole
from calibration.ball_outline import find_outline
from calibration.camera import LEVEL
from tests.calibration.ball_pictures import BallScene, photograph, scene_of, trace

RATIOS = (5.0, 10.0, 20.0)
RADII_PX = (210.0, 420.0)
OFF_AXIS_RAD = (0.0, 0.3)
SHIFTS_PX = ((0.3, -0.4), (4.1, 2.6))
_FAR = 1e6

Picture = NDArray[np.float32]
Calibrate = Callable[[Picture, BallScene], BallFit]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return one row per D/R and way: {stage, case, system, ms, accuracy}."""
    del repeats  # every picture is a repeat
    rows = []
    for ratio in RATIOS:
        pictures = [(scene, photograph(scene, supersampling=3)) for scene in scenes(ratio)]
        for system, calibrate in WAYS.items():
            times_ms, figures = [], []
            for scene, picture in pictures:
                if calibrate is not known_focal_length and scene.centre[0] > 0:
                    continue
                start_s = time.perf_counter()
                fit = calibrate(picture, scene)
                times_ms.append((time.perf_counter() - start_s) * 1e3)
                figures.append(accuracy(fit, scene))
            keys = figures[0].keys()
            rows.append(
                {
                    "stage": "ball",
                    "case": f"D/R {ratio:g}, {len(figures)} pictures",
                    "system": system,
                    "ms": median(times_ms),
                    "ratio": None,
                    "accuracy": {key: median(each[key] for each in figures) for key in keys},
                }
            )
    return rows


def scenes(ratio: float) -> list[BallScene]:
    """Return the balls at a D/R, the picture's border a tenth of the radius."""
    made = []
    for radius_px in RADII_PX:
        for off_axis_rad in OFF_AXIS_RAD:
            side = round(2.2 * radius_px / np.cos(off_axis_rad))
            for shift_px in SHIFTS_PX:
                made.append(scene_of(ratio, radius_px, (side, side), off_axis_rad, shift_px))
    return made


def known_focal_length(picture: Picture, scene: BallScene) -> BallFit:
    """All of it from the picture and the camera's focal length."""
    pinhole = Pinhole(scene.focal_px, scene.principal_px)
    return fit_ball(find_outline(picture, pinhole), scene.size_px, pinhole)


def known_distance(picture: Picture, scene: BallScene) -> BallFit:
    """D/R by a tape, and the outline taken for a circle."""
    return _circular(picture, scene, (scene.distance_ratio, 0.0))


def nothing_known(picture: Picture, scene: BallScene) -> BallFit:
    """D/R assumed."""
    return _circular(picture, scene, ASSUMED_RATIO)


def textbook(picture: Picture, scene: BallScene) -> BallFit:
    """2 asin(r/R): a ball that is infinitely far."""
    return _circular(picture, scene, (_FAR, 0.0))


def _circular(picture: Picture, scene: BallScene, ratio: tuple[float, float]) -> BallFit:
    pinhole = distant_pinhole(scene.size_px)
    return fit_ball(find_outline(picture, pinhole), scene.size_px, pinhole, ratio)


WAYS: dict[str, Calibrate] = {
    "fishlight, --focal-px": known_focal_length,
    "fishlight, --distance-ratio": known_distance,
    "fishlight, nothing known": nothing_known,
    "2 asin(r/R)": textbook,
}


def accuracy(fit: BallFit, scene: BallScene) -> dict[str, float]:
    """Return the figures of one picture."""
    width, height = scene.size_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)[::3, ::3]
    truth, hit = trace(scene, pixels)
    seen, valid = fit.calibration.unproject(pixels)
    used = valid & hit
    angle = fit.calibration.axis_angle(seen[used])
    chord = np.linalg.norm(seen[used] - truth[used] @ LEVEL.T, axis=-1)
    error = 2 * np.arcsin(np.minimum(chord / 2, 1.0))
    claimed = np.interp(angle, fit.angles_rad, fit.deviation_rad)
    near = angle < np.pi / 2
    far = ~near & (angle < np.radians(150))
    return {
        "deg_95": float(np.degrees(np.quantile(error[near], 0.95))),
        "deg_95_at_150": float(np.degrees(np.quantile(error[far], 0.95))),
        "worst_deg": float(np.degrees(error.max())),
        "valid_deg": float(np.degrees(fit.calibration.valid_angle_rad)),
        "covered": float(np.mean(error < 2 * claimed)),
    }
