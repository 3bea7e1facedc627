"""Lamps that pulse with the mains, found in the pixels: 50 Hz, 60 Hz, or none seen.

Lamps on the mains pulse at twice its frequency. An exposure shorter than a pulse catches a part of
it, another one in each frame; a rolling shutter makes bands of it. So the level of each band of
rows, compared between equal exposures, moves with cos(2π · 2 · mains · timestamp).

Input  : band levels and timestamps of equal exposures.    Output : frequency in Hz, or None.
Fails  : where the frames come in step with the pulses (60 Hz lamps at exactly 30 frames a second):
         the bands then stand still and look like the scene. Where brackets come at such a rate that
         both frequencies look alike in them, the wrong one of the two may be named.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from capture.frame import Bracket, Frame
from capture.sensor import Sensor

FREQUENCIES_HZ = (50.0, 60.0)
BRACKETS_NEEDED = 24

_BANDS = 16
_COLUMNS = 160
_LEAST_WAVERING = 0.005
"""Relative rms of the levels that is worth a change of exposures: a hundredth of a stop."""

_LEAST_EXPLAINED = 0.7
"""Share of the wavering that the frequency must explain. Two sinusoid coefficients explain so much
of 24 random levels, less a cubic drift, 2 times in 10^5 (0.3 to the power 18 / 2)."""

_DRIFT_TERMS = 4


def mains_frequency_hz(timestamps_s: Sequence[float], levels: NDArray[np.float64]) -> float | None:
    """Return the frequency of the mains whose lamps the levels show, or None.

    In each band, amplitude and phase are fitted at both frequencies, beside a slow drift.

    Parameters
    ----------
    timestamps_s : (n,) sequence of float
        Of frames of the same exposure; a delay that they share does no harm.
    levels : (n, bands) float64
        Mean linear value of each band of rows, from `band_levels`.
    """
    if len(timestamps_s) < BRACKETS_NEEDED:
        return None
    time_s = np.asarray(timestamps_s, np.float64) - np.mean(timestamps_s)
    is_lit = levels.mean(axis=0) > 0.0
    relative = levels[:, is_lit] / levels[:, is_lit].mean(axis=0)
    drift = np.vander(time_s / max(np.abs(time_s).max(), 1e-9), _DRIFT_TERMS)
    wavering = _residual(drift, relative)
    if wavering.size == 0 or np.sqrt((wavering**2).mean()) < _LEAST_WAVERING:
        return None
    explained = []
    for frequency_hz in FREQUENCIES_HZ:
        angle_rad = 2.0 * math.pi * (2.0 * frequency_hz) * time_s
        wave = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
        rest = _residual(np.concatenate([drift, wave], axis=-1), relative)
        explained.append(1.0 - (rest**2).sum() / (wavering**2).sum())
    best = int(np.argmax(explained))
    return FREQUENCIES_HZ[best] if explained[best] >= _LEAST_EXPLAINED else None


def _residual(columns: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what is left of `values` (n, m) after a least-squares fit of `columns` (n, k)."""
    coefficients = np.linalg.lstsq(columns, values, rcond=None)[0]
    return values - columns @ coefficients


def band_levels(frame: Frame, sensor: Sensor) -> NDArray[np.float64]:
    """Return the mean linear value of each of 16 bands of rows, (16,)."""
    height, width = frame.counts.shape[:2]
    columns = frame.counts[:, :: -(-width // _COLUMNS)]
    rows = sensor.linear_table()[columns, np.arange(3)].mean(axis=(1, 2), dtype=np.float64)
    edges = np.linspace(0, height, min(_BANDS, height) + 1).astype(np.int64)
    return np.add.reduceat(rows, edges[:-1]) / np.diff(edges)


class MainsWatch:
    """Remembers the shortest exposures of the last brackets, and the mains frequency once seen.

    The shortest shows a lamp's pulse best. Once found, the frequency stays: exposures of whole
    pulses, which it leads to, hide it.
    """

    def __init__(self) -> None:
        self.frequency_hz = 0.0
        self._time_s = 0.0
        self._timestamps_s: list[float] = []
        self._levels: list[NDArray[np.float64]] = []

    def look_at(self, bracket: Bracket, sensor: Sensor) -> float:
        """Take a bracket in, and return the mains frequency as far as it is known, or 0."""
        if self.frequency_hz:
            return self.frequency_hz
        frame = bracket.by_signal()[0]
        if frame.exposure.time_s != self._time_s:
            self._time_s = frame.exposure.time_s
            self._timestamps_s, self._levels = [], []
        self._timestamps_s = [*self._timestamps_s, frame.timestamp_s][-BRACKETS_NEEDED:]
        self._levels = [*self._levels, band_levels(frame, sensor)][-BRACKETS_NEEDED:]
        self.frequency_hz = mains_frequency_hz(self._timestamps_s, np.array(self._levels)) or 0.0
        return self.frequency_hz
