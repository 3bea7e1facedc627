"""The merge against OpenCV's two, on brackets of known truth, in one process.

Times  : ours, MergeDebevec and MergeRobertson with the true response, alternating, medians.
Accuracy, per system:
`error_stops`  : rms |log2(merged / truth)| where the longest exposure is above 2 % of its range;
`expected_stops`: what it comes to by the variance that ours returns: the noise of the counts, below
                 which no estimate gets that takes them for what they are;
`bright_flux`  : flux of the pixels that only the shortest exposure can see, over the true flux;
`clipped_value`: what a pixel full in every exposure gets, over the lower bound it must not miss.
"""

import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.frame import Bracket, Exposure
from capture.merge import merge_bracket
from capture.sensor import Sensor
from tests.capture.simulated_bracket import SRGB_8_BIT, record

SIDE_PX = 1024
CLIPPED_PX = 16
"""Side of the patch whose radiance is ten times what the shortest exposure can hold."""

LINEAR_16_BIT_NO_BLACK = Sensor(black_dn=0.0, white_dn=65535.0, source="simulated linear")
"""OpenCV's 16-bit merge knows no black level."""

Merge = Callable[[], NDArray[np.float32]]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return one row per case and system: {stage, case, system, ms, ratio, accuracy}."""
    rows = []
    for name, sensor, times_s in [
        ("3 × 1024² 8-bit", SRGB_8_BIT, [4.0 ** (2 * k - 5) for k in range(3)]),
        ("5 × 1024² 8-bit", SRGB_8_BIT, [4.0 ** (k - 5) for k in range(5)]),
        ("7 × 1024² 8-bit", SRGB_8_BIT, [4.0 ** (k - 5) for k in range(7)]),
        ("3 × 1024² 16-bit linear", LINEAR_16_BIT_NO_BLACK, [4.0 ** (2 * k - 5) for k in range(3)]),
    ]:
        truth = scene(times_s)
        bracket = record(truth, [Exposure(t) for t in times_s], sensor, np.random.default_rng(2))
        systems = merges(bracket, sensor)
        times_ms = timed(list(systems.values()), repeats)
        ours = merge_bracket(bracket, sensor)
        relative_variance = ours.variance / truth**2
        expected = float(np.sqrt(relative_variance[measured(truth, times_s)].mean()) / np.log(2))
        for (system, merge), ms in zip(systems.items(), times_ms, strict=True):
            rows.append(
                {
                    "stage": "merge",
                    "case": name,
                    "system": system,
                    "ms": ms,
                    "ratio": ms / times_ms[0],
                    "accuracy": accuracy(merge(), truth, times_s)
                    | ({"expected_stops": expected} if system == "fishlight" else {}),
                }
            )
    return rows


def scene(times_s: Sequence[float]) -> NDArray[np.float64]:
    """Smooth radiance over the bracket's range, with a few lights and a patch beyond it."""
    rng = np.random.default_rng(1)
    brightest = 1 / times_s[0]
    texture = cv2.GaussianBlur(rng.normal(0, 1, (SIDE_PX, SIDE_PX, 3)), (0, 0), 12)
    radiance = np.exp(texture / texture.std()) * 0.2 / times_s[-1]
    lights = cv2.GaussianBlur(rng.normal(0, 1, (SIDE_PX, SIDE_PX)), (0, 0), 6)
    radiance[lights > np.quantile(lights, 0.99)] = 0.8 * brightest
    radiance[:CLIPPED_PX, :CLIPPED_PX] = 10 * brightest
    return radiance


def merges(bracket: Bracket, sensor: Sensor) -> dict[str, Merge]:
    """Return the systems that accept this bracket; OpenCV's with the true response."""
    pictures = [frame.counts for frame in bracket.frames]
    times_s = np.array([frame.exposure.time_s for frame in bracket.frames], np.float32)
    # MergeDebevec takes the logarithm of the response; 0 would be −∞.
    response = np.maximum(sensor.linear_table(), 1e-6).reshape(-1, 1, 3)
    return {
        "fishlight": lambda: merge_bracket(bracket, sensor).radiance,
        "OpenCV MergeDebevec": lambda: cv2.createMergeDebevec().process(
            pictures, times_s, response
        ),
        "OpenCV MergeRobertson": lambda: cv2.createMergeRobertson().process(
            pictures, times_s, response
        ),
    }


def timed(calls: Sequence[Merge], repeats: int) -> list[float]:
    """Median milliseconds of each call; they take turns, so that all meet the same disturbances."""
    for call in calls:
        call()
    samples_ms: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for call, samples in zip(calls, samples_ms, strict=True):
            start_s = time.perf_counter()
            call()
            samples.append((time.perf_counter() - start_s) * 1e3)
    return [median(samples) for samples in samples_ms]


def measured(truth: NDArray[np.float64], times_s: Sequence[float]) -> NDArray[np.bool_]:
    """Return where truth lies between 2 % of the longest exposure's range and the shortest's."""
    return (truth * times_s[-1] > 0.02) & (truth < 1 / times_s[0])


def accuracy(
    merged: NDArray[np.float32], truth: NDArray[np.float64], times_s: Sequence[float]
) -> dict[str, float]:
    """Return the three figures of a system that this module's docstring names."""
    bound = 1 / times_s[0]
    seen = measured(truth, times_s)
    bright = (truth * times_s[1] > 1) & (truth < bound)
    with np.errstate(divide="ignore"):
        stops = np.log2(merged[seen] / truth[seen])
    return {
        "error_stops": float(np.sqrt(np.mean(stops**2))),
        "bright_flux": float(merged[bright].sum(dtype=np.float64) / truth[bright].sum()),
        "clipped_value": float(merged[:CLIPPED_PX, :CLIPPED_PX].mean() / bound),
    }
