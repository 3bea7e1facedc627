"""How many lights there is time for: a count that follows the time that frames took.

Where frames take a + b n milliseconds with n lights, a and b at least 0, a growth never ends over
the budget: n grows by at most the ratio of the time aimed at to the time taken, and a is not paid
twice. So what shrinks only shrinks until it fits, and nothing oscillates. Timings that scatter are
judged by their median, against a band that is wide while they are few and then 0.7 to 1 of the
budget: with 10 % of normal noise the count changes once in a thousand frames, with 20 % once in
eighty.

Fails : where even the fewest lights take longer than the budget, the fewest it is. A load that
        comes and goes with a period of many frames is followed.
"""

from collections.abc import Sequence
from statistics import median

FIRST_COUNT = 32
"""To start with, before anything was timed."""
FRAMES = 12
"""Frames whose times are judged together."""

_FEWEST_FRAMES = 3
_AIM = 0.85
_BAND = (0.7, 1.0)
_BAND_OF_FEW_FRAMES = (0.5, 1.3)
_MOST_CHANGE = 2.0


def next_count(
    most: int, drawn: int, took_ms: Sequence[float], budget_ms: float, fewest: int = 1
) -> int:
    """Return the most lights that the next frame may have, at least `fewest`.

    Parameters
    ----------
    most : int
        That of the last frame.
    drawn : int
        Lights that the last frame had, at most `most`: fewer where fewer were good enough.
    took_ms : sequence of float
        Milliseconds of the last frames with the same `most`, up to `FRAMES` of them. After fewer
        than three nothing changes.
    budget_ms : float
        Milliseconds that a frame may take.
    fewest : int
        Below it their number is not brought.
    """
    if len(took_ms) < _FEWEST_FRAMES:
        return most
    use = median(took_ms) / budget_ms
    least, largest = _BAND if len(took_ms) >= FRAMES else _BAND_OF_FEW_FRAMES
    if least <= use <= largest:
        return most
    change = min(max(_AIM / use, 1 / _MOST_CHANGE), _MOST_CHANGE) if use > 0 else _MOST_CHANGE
    fitting = int(drawn * change)
    # Growing from what was drawn, `most` never runs far ahead of what was timed.
    return max(most, fitting) if use < least else max(min(most - 1, fitting), fewest)
