"""What the temporal stage makes of a sequence, in figures, on small maps and few surfaces."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from lighting.measures.error_measures import (
    Receivers,
    received,
    received_from_map,
    standard_receivers,
)
from lighting.measures.steadiness import direction_motion, error_change, excess_change
from lighting.reduce import reduce_next
from lighting.simulation.sequences import SEQUENCES, frames
from lighting.stream.temporal import steady

ROWS, COUNT, FRAMES = 16, 32, 36
STARTED = 12
"""Figures are of the frames from here on."""
_WALL = standard_receivers()["wall"]
SURFACES = Receivers(_WALL.normals[::4], _WALL.openings[::4])
"""48 surfaces, each behind the edge of a wall."""


@dataclass(frozen=True)
class Figures:
    """Means over frames but for the largest turn; light relative to the true light."""

    error: float
    excess_change: float
    error_change: float
    motion_deg: float
    largest_turn_deg: float


@cache
def figures(name, method):
    """Return the Figures without the temporal stage and with it."""
    timed_maps = list(frames(SEQUENCES[name], ROWS, FRAMES))
    true = np.array([received_from_map(SURFACES, timed.truth) for timed in timed_maps[STARTED:]])
    plain, smooth = [], []
    reduced_memory = steady_memory = None
    for timed in timed_maps:
        lights, reduced_memory = reduce_next(
            timed.environment, COUNT, method, reduced_memory, timestamp_s=timed.timestamp_s
        )
        plain.append(lights)
        lights, steady_memory = steady(lights, steady_memory)
        smooth.append(lights)
    return _figures(plain[STARTED:], true), _figures(smooth[STARTED:], true)


def _figures(light_sets, true):
    measured = np.array([received(SURFACES, lights) for lights in light_sets])
    motion = np.degrees([direction_motion(*two) for two in pairwise(light_sets)])
    return Figures(
        float(np.sqrt(np.mean((measured - true) ** 2) / np.mean(true**2))),
        float(excess_change(measured, true).mean()),
        float(error_change(measured, true).mean()),
        float(motion[:, 0].mean()),
        float(motion[:, 1].max()),
    )
