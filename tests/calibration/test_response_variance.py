"""The variance of radiance that was merged with an estimated response, against its true error."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.response import estimate_response, sensor_with
from capture.merge import merge_bracket
from capture.sensor import assumed_sensor
from tests.calibration.response_scenes import bracket, scene


@pytest.mark.parametrize("name", ["srgb", "film"])
def test_it_covers_the_curve_as_well_as_the_noise(name):
    # Each bracket is merged with the response that another one gave, and its radiance scaled to
    # the truth, for a response has no scale of its own.
    error, stated, noise = np.zeros((3, 6))
    for seed in range(2):
        response = estimate_response([bracket(name, seed)])
        sensor = sensor_with(assumed_sensor(np.uint8), response)
        truth, seen = scene(seed + 50), bracket(name, seed + 50)
        image = merge_bracket(seen, sensor)
        exact = merge_bracket(seen, replace(sensor, response_deviation=None))
        scale = np.median(image.radiance / truth)
        level = np.minimum(-np.log2(truth) / 2, 5).astype(int)[~image.clipped].ravel()
        for total, values in (
            (error, (image.radiance / scale - truth) ** 2),
            (stated, image.variance / scale**2),
            (noise, exact.variance / scale**2),
        ):
            total += np.bincount(level, values[~image.clipped].ravel(), 6)
    # By 2 EV of radiance; over more responses 0.87 to 1.09.
    assert (error / stated < 1.15).all()
    assert (error / stated > 0.8).all()
    assert (error / noise).max() > 1.05  # the noise alone does not cover it
