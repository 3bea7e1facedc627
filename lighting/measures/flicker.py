"""How much the lights of each system flicker on skies that change: the chart's last figure.

A sequence of sequences.py is reduced frame by frame, with what a system remembers of the frame
before. What surfaces behind the sphere of error_measures.py receive from the lights as points may
change as much as what they receive from the maps that the lights were made of. What it changes
more is flicker: the root mean square over the frames of steadiness.excess_change. Noise and mains
that the maps have are not charged to the lights, only what the lights add.

Input  : systems of chart.py.    Output : a measurement for each sequence, system and count.
Cost   : on two cores about a minute and a half for all sequences and counts.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.measures.chart import FLICKER, Measurement, System, lighting_digest
from lighting.measures.error_measures import received, received_from_map, standard_receivers
from lighting.measures.known import remembered
from lighting.measures.steadiness import excess_change
from lighting.simulation.sequences import Sequence as SkySequence
from lighting.simulation.sequences import frames

Array = NDArray[np.float64]

COUNTS = (4, 16, 64, 256)
FRAMES = 8
ROWS = 64
_SLOW_S = 0.2
"""A system that takes longer for a frame is not tried with more lights."""


def measure(
    sequences: Mapping[str, SkySequence],
    compared: Mapping[str, System],
    counts: Sequence[int],
    known: dict[str, Measurement],
) -> Iterator[Measurement | None]:
    """Yield a measurement of each sequence, system and count, as `chart.measure` does of maps."""
    for name, sequence in sequences.items():
        measured = _on_sequence(name, sequence, compared)
        digest = f"{lighting_digest()} {name}"
        yield from remembered(measured, digest, compared, counts, known, _SLOW_S)


def _on_sequence(
    sequence_name: str, sequence: SkySequence, compared: Mapping[str, System]
) -> Callable[[str, int], Measurement]:
    """Return what measures a system with a count on one sequence."""
    sphere = standard_receivers()["sphere"]

    @cache  # made when first needed: it takes a second
    def maps_and_light() -> tuple[list[EnvironmentMap], Array]:
        maps = [timed.environment for timed in frames(sequence, ROWS, FRAMES)]
        return maps, np.array([received_from_map(sphere, environment) for environment in maps])

    def measured(name: str, count: int) -> Measurement:
        maps, true = maps_and_light()
        sets, times_ms, memory = [], [], None
        for environment in maps:
            start = time.perf_counter()
            lights, memory = compared[name](environment, count, memory)
            times_ms.append(1e3 * (time.perf_counter() - start))
            sets.append(lights)
        light = np.array([received(sphere, lights, as_points=True) for lights in sets])
        flicker = float(np.sqrt(np.mean(excess_change(light, true) ** 2)))
        most = max(len(lights) for lights in sets)
        figures = {FLICKER: flicker}
        return Measurement(sequence_name, name, count, most, fmean(times_ms), figures)

    return measured
