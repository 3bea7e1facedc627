"""Responses estimated from brackets of known truth, ours against published methods and OpenCV's.

Maps     : those of the bundled recordings, as a camera of 1024×512 px that looks everywhere; or the
           EXR files named in FISHLIGHT_BENCH_MAPS. Three true curves each, five exposures 2 EV
           apart, 8 bits, shot and read noise.
Times    : of the estimate alone, medians over the cases.
Accuracy : medians and worst over the cases, up to a common scale:
`curve_stops`    : rms log2 error of the curve over counts 20 to 240;
`worst_stops`    : the largest of them;
`radiance_stops` : rms |log2| error of the merged radiance where the longest exposure is above 2 %
                   of its range;
`covered`        : share of those pixels whose error is within 1.96 predicted standard deviations.
"""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.response import METHODS, Response, sensor_with
from calibration.response_curve import Curve, disagreement_ev, scaled
from calibration.response_samples import sample_brackets
from capture.errors import InputError
from capture.frame import Bracket, Exposure
from capture.merge import merge_bracket
from capture.sensor import assumed_sensor
from lighting.maps.environment_files import read_environment
from tests.calibration.response_scenes import CURVES, error_ev, true_sensor
from tests.capture.simulated_bracket import record

BUNDLED = sorted(Path(__file__).parents[2].glob("recordings/*/truth/map-0000.exr"))
SIZE_PX = (1024, 512)

Estimate = Callable[[Bracket], Curve]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return one row per system: {stage, case, system, ms, ratio, accuracy}."""
    del repeats  # every case is a repeat
    cases = list(brackets())
    rows: list[dict[str, Any]] = []
    for system, estimate in systems().items():
        figures, times_ms = [], []
        for name, radiance, bracket in cases:
            start_s = time.perf_counter()
            curve = estimate(bracket)
            times_ms.append((time.perf_counter() - start_s) * 1e3)
            figures.append(accuracy(curve, name, radiance, bracket))
        curve_stops, radiance_stops, covered = np.array(figures).T
        rows.append(
            {
                "stage": "response",
                "case": f"{len(cases)} brackets of 5 × 1024×512 8-bit",
                "system": system,
                "ms": median(times_ms),
                "ratio": median(times_ms) / (rows[0]["ms"] if rows else median(times_ms)),
                "accuracy": {
                    "curve_stops": median(curve_stops),
                    "worst_stops": max(curve_stops),
                    "radiance_stops": median(radiance_stops),
                    "covered": median(covered),
                },
            }
        )
    return rows


def brackets() -> Iterator[tuple[str, NDArray[np.float64], Bracket]]:
    """Yield true curve's name, radiance and bracket of every case that determines a response."""
    named = os.environ.get("FISHLIGHT_BENCH_MAPS", "")
    paths = [Path(each) for each in named.split(os.pathsep) if each] or BUNDLED
    for seed, path in enumerate(paths):
        cells = read_environment(path)[0].radiance
        radiance = np.maximum(cv2.resize(cells, SIZE_PX, interpolation=cv2.INTER_LINEAR), 1e-6)
        shortest_s = 0.8 / float(np.quantile(radiance, 0.9995))
        exposures = [Exposure(shortest_s * 4.0**k) for k in range(5)]
        for name in CURVES:
            rng = np.random.default_rng(seed)
            bracket = record(radiance.astype(np.float64), exposures, true_sensor(name), rng)
            try:
                sample_brackets([bracket])
            except InputError as error:
                print(f"{path.name}, {name}: {error}")
                continue
            yield name, radiance.astype(np.float64), bracket


def systems() -> dict[str, Estimate]:
    """Return how each system makes a curve of a bracket."""
    ours = {
        f"fishlight {name}": lambda bracket, fit=fit: fit(sample_brackets([bracket]))
        for name, fit in METHODS.items()
    }
    return ours | {
        "OpenCV CalibrateDebevec": lambda bracket: _opencv(cv2.createCalibrateDebevec(), bracket),
        "OpenCV CalibrateRobertson": lambda bracket: _opencv(
            cv2.createCalibrateRobertson(), bracket
        ),
    }


def accuracy(
    curve: Curve, name: str, radiance: NDArray[np.float64], bracket: Bracket
) -> tuple[float, float, float]:
    """Return rms error of the curve and of the merged radiance, and the share covered."""
    samples = sample_brackets([bracket])
    held_out_ev = disagreement_ev(samples, curve)
    response = Response("", curve, held_out_ev, held_out_ev, len(samples))
    image = merge_bracket(bracket, sensor_with(assumed_sensor(np.uint8), response))
    longest = bracket.by_signal()[-1].exposure.signal
    seen = (radiance * longest > 0.02) & ~image.clipped[..., None] & (image.radiance > 0)
    ratio = image.radiance[seen] / radiance[seen]
    stops = np.log2(ratio)
    stops -= np.median(stops)
    relative = np.sqrt(image.variance[seen]) / image.radiance[seen]
    covered = np.abs(stops) * np.log(2) < 1.96 * relative
    curve_stops = float(np.sqrt(np.mean(error_ev(curve, name) ** 2)))
    return curve_stops, float(np.sqrt(np.mean(stops**2))), float(covered.mean())


def _opencv(calibrate: Any, bracket: Bracket) -> Curve:
    pictures = [frame.counts for frame in bracket.frames]
    times_s = np.array([frame.exposure.time_s for frame in bracket.frames], np.float32)
    values = calibrate.process(pictures, times_s).reshape(256, 3).astype(np.float64)
    values = np.nan_to_num(values, nan=1e-6, posinf=1.0)
    return Curve(scaled(values), None, np.zeros(len(pictures)))
