"""How many lights there is time for: a count that follows the time that frames took.

Where frames take a + b n milliseconds with n lights, a and b at least 0, a growth never ends over
the budget: n grows by at most the ratio of the time aimed at to the time taken, and a is not paid
twice. So what shrinks only shrinks until it fits, and nothing oscillates. Between 0.7 and 1 of the
budget nothing changes, which leaves room for timings that scatter by a sixth; single slow frames do
not count at all.

Fails : where even one light takes longer than the budget, one light it is. A load that comes and
        goes with a period of many frames is followed.
"""

from collections.abc import Sequence
from statistics import median

FIRST_COUNT = 32
"""To start with, before anything was timed."""
FRAMES = 3
"""Frames that a count is kept for at least: their median is judged."""

_AIM = 0.85
_LEAST_USE = 0.7
_MOST_CHANGE = 2.0


def next_count(most: int, drawn: int, took_ms: Sequence[float], budget_ms: float) -> int:
    """Return the most lights that the next frame may have, at least 1.

    Parameters
    ----------
    most : int
        That of the last frame.
    drawn : int
        Lights that the last frame had, at most `most`: fewer where fewer were good enough.
    took_ms : sequence of float
        Milliseconds of the frames since `most` changed, the newest last. With fewer than `FRAMES`
        of them nothing changes.
    budget_ms : float
        Milliseconds that a frame may take.
    """
    if len(took_ms) < FRAMES:
        return most
    use = median(took_ms[-FRAMES:]) / budget_ms
    if _LEAST_USE <= use <= 1:
        return most
    change = min(max(_AIM / use, 1 / _MOST_CHANGE), _MOST_CHANGE) if use > 0 else _MOST_CHANGE
    fitting = int(drawn * change)
    # What was not drawn says nothing of more lights than twice as many: `most` stays near.
    return max(most, fitting) if use < _LEAST_USE else max(min(most - 1, fitting), 1)
