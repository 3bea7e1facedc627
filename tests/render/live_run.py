"""A live session of so many brackets, and what came of it."""

import time
from dataclasses import dataclass, field, replace

import numpy as np

from calibration.files import read_calibration
from capture.frame import Bracket
from render.live.desk import Desk
from render.live.models import load_models
from render.live.session import LiveSession
from render.live.settings import Settings

MODELS = load_models(())


class Source:
    """A recording's brackets as they can be taken, or what stands in the place of some.

    `before` is called with the number of each, when the one before it was done with.
    """

    name = "simulated"
    reopened_count = 0

    def __init__(self, recording, count, before, instead):
        self.size_px, self.sensor = recording.size_px, recording.sensor
        self.done = 0
        self._recording, self._count = recording, count
        self._before, self._instead = before, instead

    def __iter__(self):
        for number in range(self._count):
            while self.done < number:
                time.sleep(0.001)
            self._before(number)
            if number in self._instead:
                self.done += 1
                yield self._instead[number]
                continue
            bracket = self._recording.read_bracket(number % len(self._recording))
            now_s = time.monotonic()
            frames = tuple(replace(frame, timestamp_s=now_s) for frame in bracket.frames)
            yield Bracket(frames, number)


@dataclass
class Drawer:
    """Draws white, and remembers what of."""

    size_px: tuple = (64, 48)
    is_draft: bool = False
    is_settled: bool = True
    takes_s: float = 0.0
    asked: list = field(default_factory=list)

    def render(self, settings, lights, background, wanted_px=None):
        wanted_px = wanted_px or self.size_px
        self.asked.append((settings, lights, background))
        time.sleep(self.takes_s * wanted_px[0] / self.size_px[0])
        return np.ones((*wanted_px[::-1], 4), np.float32)


@dataclass
class Ran:
    counters: object
    moments: list
    drawn: list
    desk: Desk

    @property
    def states(self):
        return [moment.state.name for moment in self.moments]


def run(
    recording, count=6, *, before=None, instead=None, settings=None, watched=True, work=None,
    drawer=None,
):  # fmt: skip
    """Return what came of a session of `count` brackets; `before` takes the desk and a number."""
    desk = Desk(settings or Settings(count=20), MODELS)
    desk.watchers = int(watched)
    moments = {}
    desk.listen(lambda: desk.newest and moments.setdefault(desk.newest.number, desk.newest))
    act = before or (lambda _desk, _number: None)
    source = Source(recording, count, lambda number: act(desk, number), instead or {})
    drawer = drawer or Drawer()

    def done(bracket, seen):
        if work is not None:
            work(desk, bracket, seen)
        source.done += 1

    calibration = read_calibration(recording.calibration_path)
    counters = LiveSession(desk, source, calibration, 32, drawer, done).run()
    return Ran(counters, list(moments.values()), drawer.asked, desk)
