"""A camera of known noise, for tests: radiance in, the bracket it would record out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from capture.frame import Bracket, Exposure, Frame
from capture.sensor import Sensor, assumed_sensor

SRGB_8_BIT = assumed_sensor(np.uint8)
DOUBTFUL_AT_WHITE = replace(
    SRGB_8_BIT, response_deviation=np.where(np.arange(256) < 253, 0.0, 0.5)[:, None] * np.ones(3)
)
"""sRGB, as if measured: what lies above saturation was not seen and is extrapolated."""

LINEAR_16_BIT = Sensor(black_dn=1024.0, white_dn=65535.0, source="simulated linear")


def record(
    radiance: NDArray[np.float64],
    exposures: Sequence[Exposure],
    sensor: Sensor,
    rng: np.random.Generator,
) -> Bracket:
    """Return the bracket that `sensor` records of `radiance` (H, W, 3), with noise and clipping."""
    dtype = np.uint8 if sensor.white_dn <= 255 else np.uint16
    frames = []
    for index, exposure in enumerate(exposures):
        electrons = rng.poisson(np.minimum(radiance * exposure.light, 100.0) * sensor.full_well_e)
        electrons = electrons + rng.normal(0.0, sensor.read_noise_e, radiance.shape)
        linear = electrons * exposure.gain / sensor.full_well_e
        counts = np.clip(np.rint(encode(linear, sensor)), 0, sensor.white_dn).astype(dtype)
        frames.append(Frame(counts, exposure, index=index))
    return Bracket(tuple(frames))


def encode(linear: NDArray[np.float64], sensor: Sensor) -> NDArray[np.float64]:
    """Return the unrounded counts of linear values (..., 3); the inverse of the response."""
    if sensor.response is None:
        return sensor.black_dn + linear * (sensor.white_dn - sensor.black_dn)
    counts = np.arange(len(sensor.response))
    return np.stack(
        [np.interp(linear[..., c], sensor.response[:, c], counts) for c in range(3)], axis=-1
    )
