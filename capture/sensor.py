"""The sensor model: what a count says about the light that made it.

Input  : counts in DN.    Output : linear values, 0 at black and 1 at white, and their noise.
Fails  : where the response is assumed rather than measured: a camera's JPEG curve differs from
         sRGB by up to a stop near white, and radiance is then off by as much.
"""

from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from capture.arrays import read_only
from capture.errors import InputError
from capture.primaries import PRIMARIES, PrimariesName, to_rec709

SATURATION_RANGE = (1e-3, 1.0)
FULL_WELL_RANGE_E = (1.0, 1e9)
READ_NOISE_RANGE_E = (0.0, 1e6)
"""What any sensor does, with room; beyond, the merge's float32 would over- or underflow."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """Black and white level, response and noise of one camera.

    Attributes
    ----------
    black_dn, white_dn : float
        Counts for no light and for a full pixel.
    response : (white_dn + 1, 3) float64, or None
        Linear value of each count per channel, rising from 0 at black to 1 at white; None means
        linear.
    saturation : float
        Linear value from which on a count is taken to be clipped.
    full_well_e : float
        Electrons at the linear value 1 and gain 1: sets the photon noise.
    read_noise_e : float
        Standard deviation of the read-out, in electrons.
    source : str
        Where the numbers come from ("assumed sRGB", "DNG header", ...), shown to the user.
    response_deviation : (white_dn + 1, 3) float64, or None
        Standard deviation of `response` where it was estimated; None takes it for exact.
    colour_matrix : (3, 3) float64, or None
        Linear Rec.709 (or RGB of the primaries that `in_primaries` chose) of linear values of the
        three channels; None takes these for Rec.709.
    primaries : "rec709", "rec2020" or "acescg"
        What radiance becomes.
    """

    black_dn: float
    white_dn: float
    response: NDArray[np.float64] | None = None
    saturation: float = 0.98
    full_well_e: float = 30_000.0
    read_noise_e: float = 4.0
    source: str = "assumed linear"
    response_deviation: NDArray[np.float64] | None = None
    colour_matrix: NDArray[np.float64] | None = None
    primaries: PrimariesName = "rec709"

    def __post_init__(self) -> None:
        if not 0 <= self.black_dn <= self.white_dn - 1 <= 65534:
            raise ValueError(
                f"black {self.black_dn:g} must lie below white {self.white_dn:g}, of at most 65535"
            )
        for name, value, (least, most) in (
            ("saturation", self.saturation, SATURATION_RANGE),
            ("full_well_e", self.full_well_e, FULL_WELL_RANGE_E),
            ("read_noise_e", self.read_noise_e, READ_NOISE_RANGE_E),
        ):
            if not least <= value <= most:
                raise ValueError(f"{name} must be from {least:g} to {most:g}, got {value:g}")
        if self.response is not None:
            shape = (int(self.white_dn) + 1, 3)
            response = read_only("response", self.response, np.float64, shape)
            if not np.all(np.isfinite(response)) or np.any(np.diff(response, axis=0) < 0):
                raise ValueError("response must be finite and must not fall")
            ends = response[[int(self.black_dn), -1]]
            if not np.allclose(ends, [[0.0], [1.0]], rtol=0, atol=1e-3):
                raise ValueError("response must rise from 0 at black to 1 at white")
            object.__setattr__(self, "response", response)
        if self.response_deviation is not None:
            if self.response is None:
                raise ValueError("a linear response has no response_deviation")
            deviation = read_only(
                "response_deviation", self.response_deviation, np.float64, self.response.shape
            )
            if not np.all((deviation >= 0) & (deviation <= 1)):
                raise ValueError("response_deviation must be from 0 to 1")
            object.__setattr__(self, "response_deviation", deviation)
        if self.colour_matrix is not None:
            matrix = read_only("colour_matrix", self.colour_matrix, np.float64, (3, 3))
            if not np.all(np.abs(matrix) <= 1000) or np.linalg.cond(matrix) > 1e6:
                raise ValueError("colour_matrix must be invertible, of numbers from -1000 to 1000")
            object.__setattr__(self, "colour_matrix", matrix)

    def check_counts(self, dtype: DTypeLike) -> None:
        """Raise InputError if integer counts of `dtype` cannot be this sensor's.

        8-bit counts go with a white level of 255 or less, 16-bit ones with a higher one; float
        counts, which hold linear values, go with any.
        """
        if np.dtype(dtype) == np.float32:
            return
        is_8_bit = np.dtype(dtype) == np.uint8
        if is_8_bit != (self.white_dn <= 255):
            raise InputError(
                f"{8 if is_8_bit else 16}-bit counts, but their sensor ({self.source}) is white at "
                f"{self.white_dn:g}; give the camera's own white level"
            )

    def linear_table(self) -> NDArray[np.float32]:
        """(65536 or 256, 3) linear value of every count; not clamped below black."""
        length = 256 if self.white_dn <= 255 else 65536
        counts = np.arange(length, dtype=np.float64)
        if self.response is None:
            column = (counts - self.black_dn) / (self.white_dn - self.black_dn)
            return np.repeat(column[:, None], 3, axis=1).astype(np.float32)
        inside = np.minimum(counts.astype(np.int64), len(self.response) - 1)
        return self.response[inside].astype(np.float32)

    def step_variance_table(self) -> NDArray[np.float64]:
        """(65536 or 256, 3) variance of the linear value that each count stands for.

        A count's step is half the distance between the neighbouring levels, so counts that share
        one level, a flat part of an estimated response, are as uncertain as the gap that they
        leave. The variance of an estimated response is added.
        """
        linear = self.linear_table().astype(np.float64)
        variance = np.empty_like(linear)
        for channel in range(3):
            levels, level_of_count = np.unique(linear[:, channel], return_inverse=True)
            variance[:, channel] = (np.gradient(levels) ** 2 / 12.0)[level_of_count]
        if self.response_deviation is not None:
            inside = np.minimum(np.arange(len(variance)), len(self.response_deviation) - 1)
            variance += self.response_deviation[inside] ** 2
        return variance

    def variance_table(self, gain: float) -> NDArray[np.float64]:
        """(65536 or 256, 3) variance of the linear value of each count: photons, read-out, step."""
        electrons = self.full_well_e / gain
        photons = np.maximum(self.linear_table(), 0) / electrons
        return photons + (self.read_noise_e / electrons) ** 2 + self.step_variance_table()


def in_primaries(sensor: Sensor, name: PrimariesName) -> Sensor:
    """Return the sensor whose radiance is linear RGB of these primaries."""
    if name == sensor.primaries:
        return sensor
    old, new = (to_rec709(PRIMARIES[each]) for each in (sensor.primaries, name))
    matrix = np.asarray(np.linalg.solve(new, old), np.float64)
    if sensor.colour_matrix is not None:
        matrix = matrix @ sensor.colour_matrix
    return replace(sensor, colour_matrix=matrix, primaries=name)


@lru_cache(maxsize=16)
def clear_level(sensor: Sensor, gain: float, snr: float) -> float:
    """Return the least linear value with a signal to noise ratio of `snr` in every channel.

    It is above 0, and infinite if no count of the sensor has that ratio. Counts above it may lack
    it again, where an estimated response is uncertain.
    """
    linear = sensor.linear_table().astype(np.float64)
    is_clear = (linear > 0.0) & (linear >= snr * np.sqrt(sensor.variance_table(gain)))
    return float(np.where(is_clear, linear, np.inf).min(axis=0).max())


def srgb_decode(value: NDArray[Any]) -> NDArray[np.float64]:
    """Linear value of sRGB-coded values in [0, 1] (IEC 61966-2-1)."""
    value = np.asarray(value, np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb_encode(linear: NDArray[np.floating]) -> NDArray[np.floating]:
    """sRGB-coded value of linear values in [0, 1] (IEC 61966-2-1), in their own precision."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def assumed_sensor(dtype: DTypeLike) -> Sensor:
    """Sensor for counts whose camera is unknown: 8-bit is sRGB-coded, anything else linear."""
    return _assumed_sensor(np.dtype(dtype) == np.uint8)


@cache
def _assumed_sensor(is_8_bit: bool) -> Sensor:
    if is_8_bit:
        curve = srgb_decode(np.arange(256) / 255.0)
        response = np.repeat(curve[:, None], 3, axis=1)
        return Sensor(0.0, 255.0, response=response, source="assumed sRGB")
    return Sensor(0.0, 65535.0, source="assumed linear")
