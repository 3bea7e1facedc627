"""Counts with room between them: what a resampled picture is stored in, so that it can be merged.

Input  : counts and their Sensor.
Output : 16-bit counts, as many times finer as 16 bits allow, and the Sensor that reads them.
An old count keeps its linear value, and its variance: the finer scale does not make a measurement
finer. The exact value between two counts is that of the response's straight line between them.
Fails  : 16-bit counts have no room left, so resampling rounds them once more.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.sensor import Sensor

_MOST_COUNT = 65535


def fine_sensor(sensor: Sensor) -> Sensor:
    """Return the sensor of finer counts."""
    times = _times(sensor)
    white_dn = int(sensor.white_dn)
    old = np.arange(white_dn + 1)
    new = np.arange(white_dn * times + 1) / times
    linear = sensor.linear_table()[: white_dn + 1].astype(np.float64)
    deviation = np.sqrt(sensor.step_variance_table()[: white_dn + 1])
    return replace(
        sensor,
        black_dn=sensor.black_dn * times,
        white_dn=float(white_dn * times),
        response=_interpolated(new, old, linear),
        response_deviation=_interpolated(new, old, deviation),
    )


def fine_counts(counts: NDArray[Any], sensor: Sensor) -> NDArray[np.uint16]:
    """Return counts (H, W, 3) of `sensor` on the finer scale; those above white are white."""
    held = np.minimum(counts, int(sensor.white_dn)).astype(np.uint16)
    return held * np.uint16(_times(sensor))


def encode(linear: NDArray[np.float32], fine: Sensor) -> NDArray[np.uint16]:
    """Return the finer counts next to linear values (H, W, 3)."""
    table = fine.linear_table()[: int(fine.white_dn) + 1]
    counts = np.empty(linear.shape, np.uint16)
    for channel in range(3):
        above = np.searchsorted(table[:, channel], linear[..., channel]).clip(1, len(table) - 1)
        is_nearer_below = (
            linear[..., channel] - table[above - 1, channel]
            < table[above, channel] - linear[..., channel]
        )
        counts[..., channel] = above - is_nearer_below
    return counts


def _times(sensor: Sensor) -> int:
    return _MOST_COUNT // int(sensor.white_dn)


def _interpolated(
    new: NDArray[np.float64], old: NDArray[np.int_], columns: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.stack([np.interp(new, old, columns[:, channel]) for channel in range(3)], axis=-1)
