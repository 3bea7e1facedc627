"""Two dim lamps in one cell: the light between them slides as they change.

Claim    : with too few lights for all that there is, one cell holds two lamps, its light stands at
           their centroid, and wanders from one to the other as one dims and the other brightens.
Setup    : soft lamps of 5° radius, 20° apart, of 3 % of the sky's light together, one fading into
           the other over 12 frames; 5 and 64 lights with memory; maps of 64 rows.
Expected : with 64 lights each lamp has its own: no light near them stands between them. With 5 a
           light does, the weakness itself: it moves less than 12° a frame in the median. When the
           cells are cut anew another one is the nearest.
"""

from itertools import pairwise

import numpy as np

from lighting.reduce import reduce_next
from lighting.simulation.sequences import Sequence, Source, frames

FRAMES = 12
MIDDLE, ACROSS = np.array([0.48, 0.6, 0.64]), np.array([0.8, 0.0, -0.6])
LAMPS = [
    np.cos(np.radians(10)) * MIDDLE + side * np.sin(np.radians(10)) * ACROSS for side in (1, -1)
]


def fade(_time_s, frame):
    return (frame + FRAMES // 2 + 0.5) / FRAMES


def follow(count):
    """Return the lights of each frame."""
    lamps = tuple(
        Source(0.03, lambda _, d=direction: d, np.radians(5.0), dimming=dimming)
        for direction, dimming in zip(LAMPS, (fade, lambda t, f: 1 - fade(t, f)), strict=True)
    )
    sets, memory = [], None
    for timed in frames(Sequence(lamps), 64, FRAMES):
        lights, memory = reduce_next(timed.environment, count, memory=memory)
        sets.append(lights)
    return sets


def along_deg(lights):
    """Return where lights near the line of the lamps stand along it, from its middle."""
    near = np.abs(lights.directions @ np.cross(MIDDLE, ACROSS)) < np.sin(np.radians(6))
    directions = lights.directions[near & (lights.directions @ MIDDLE > 0.8)]
    return np.degrees(np.arctan2(directions @ ACROSS, directions @ MIDDLE))


def test_with_lights_enough_nothing_slides():
    for lights in follow(64)[2:-2]:
        places = along_deg(lights)
        for lamp in (-10, 10):
            assert np.abs(places - lamp).min() < 6


def test_with_too_few_a_light_slides_between():
    nearest = [lights.directions[np.argmax(lights.directions @ MIDDLE)] for lights in follow(5)]
    turns = [np.degrees(np.arccos(min(a @ b, 1))) for a, b in pairwise(nearest)]
    assert 0.1 < np.median(turns) < 12
