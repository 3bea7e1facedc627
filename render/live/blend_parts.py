"""The sources of a blend: what each saw last, whether it counts, what they come to together.

Input  : what the session of each source published on a desk of its own.
Output : one state, one account and one set of notices for the desk of the blend.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lighting.light_set import LightSet
from render.live.desk import Desk, LiveFrame, State
from render.live.running import LiveRequest, Stop
from render.session import Counters

_SEEING = ("running", "clipped", "dark")
"""States of a source that counts."""

_NOT_BEGUN = LiveFrame(0, State("starting"), None, 0.0, 0.0, {})
_NO_LIGHTS = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True)
class PlacedSource:
    """A source, and where its camera stands in the world frame."""

    request: LiveRequest
    place_m: tuple[float, float, float]


@dataclass
class Part:
    """A source while the blend runs.

    Attributes
    ----------
    moment : LiveFrame
        What counts of it until `look` is called again.
    told : int
        Number of its last notice that was passed on.
    """

    source: PlacedSource
    desk: Desk
    stop: Stop = field(default_factory=Stop)
    moment: LiveFrame = _NOT_BEGUN
    told: int = 0

    def look(self) -> None:
        """Have the newest moment count."""
        self.moment = self.desk.newest or _NOT_BEGUN

    @property
    def is_seeing(self) -> bool:
        """Whether what it saw last counts."""
        return self.moment.seen is not None and self.moment.state.name in _SEEING

    @property
    def lights(self) -> LightSet:
        """What it saw last; none before."""
        seen = self.moment.seen
        return _NO_LIGHTS if seen is None else seen.lights

    @property
    def name(self) -> str:
        """The camera's; until it is known, what was asked for."""
        return str(self.moment.account.get("source", self.source.request.camera.device))

    def age_s(self, now_s: float) -> float:
        """Return how old what it saw last is by now."""
        return self.moment.age_s + now_s - self.moment.published_s


def common_state(parts: Sequence[Part]) -> State:
    """Return the state of all if it is the same, else what is the matter with some."""
    states = [part.moment.state for part in parts]
    if len({state.name for state in states}) == 1:
        return State(states[0].name, " ".join(dict.fromkeys(state.message for state in states)))
    message = " ".join(
        f"{part.name}: {state.message}"
        for part, state in zip(parts, states, strict=True)
        if state.message
    )
    return State("running" if any(part.is_seeing for part in parts) else states[0].name, message)


def pass_on_notices(parts: Sequence[Part], desk: Desk) -> None:
    """Tell on `desk` what the sources told on theirs since the last call."""
    for part in parts:
        notice = part.desk.notice
        if notice is not None and notice.number > part.told:
            part.told = notice.number
            desk.answer(notice.text, is_error=notice.is_error)
    desk.is_recording = any(part.desk.is_recording for part in parts)


def common_account(parts: Sequence[Part], weights: Sequence[float], now_s: float) -> dict[str, Any]:
    """Return the numbers that people are shown: sums, and the times of the strongest source."""
    accounts = [part.moment.account for part in parts]
    strongest = accounts[weights.index(max(weights))]
    counters = [account["counters"] for account in accounts if "counters" in account]
    return {
        "counters": {name: sum(each[name] for each in counters) for name in vars(Counters())},
        "times_ms": strongest.get("times_ms", {}),
        "source": " + ".join(part.name for part in parts),
        "size_px": strongest.get("size_px"),
        "is_camera": any(account.get("is_camera") for account in accounts),
        "reopened": sum(account.get("reopened", 0) for account in accounts),
        "sources": [
            {
                "name": part.name,
                "place_m": part.source.place_m,
                "weight": round(weight, 4),
                "state": part.moment.state.name,
                "age_s": None if part.moment.seen is None else round(part.age_s(now_s), 3),
            }
            for part, weight in zip(parts, weights, strict=True)
        ],
    }
