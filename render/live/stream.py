"""The stream of lights that other programs follow: JSON, one text message for each moment.

A message is one object:

    schema      "fishlight-light-stream/1"; a later 1.x may have more keys
    frame       number of the moment; rises, and has gaps where a follower was slower
    time_s      moment of the bracket on the sender's clock, as in `lights`; never falls
    age_s       seconds from then until this was sent
    stale       true if nothing newer can be had: the camera is away, or the session has ended
    valid       false if there is nothing to go by: no light yet, no camera or calibration (one that
                is away for a moment leaves its last lights valid), all clipped, or all dark
    state       "running", "away", "clipped", "dark", "ended", … (render/live/desk.py)
    sources     of a blend: name, place_m, weight, state and age_s of each; else empty
    lights      null before the first; else the object of lights.json (lighting/light_files.py)

Newest wins: what a follower was too slow to take is never sent.
"""

from typing import Any

import msgspec

from lighting.light_files import lights_object
from render.live.desk import LiveFrame

SCHEMA = "fishlight-light-stream/1"
PROTOCOL = "fishlight-lights.1"

_VALID_STATES = ("running", "away", "ended")
_STALE_STATES = ("away", "no-camera", "calibration", "ended")


class StreamMessage(msgspec.Struct, frozen=True):
    """A moment of the stream, as a follower reads it."""

    schema: str
    frame: int
    time_s: float
    age_s: float
    stale: bool
    valid: bool
    state: str
    sources: tuple[dict[str, Any], ...] = ()
    lights: dict[str, Any] | None = None


def stream_message(frame: LiveFrame) -> str:
    """Return what followers are sent of a moment."""
    lights = None if frame.seen is None else frame.seen.lights
    message = StreamMessage(
        schema=SCHEMA,
        frame=frame.number,
        time_s=0.0 if lights is None else lights.timestamp_s,
        age_s=frame.age_s,
        stale=frame.state.name in _STALE_STATES,
        valid=lights is not None and frame.state.name in _VALID_STATES,
        state=frame.state.name,
        sources=tuple(frame.account.get("sources", ())),
        lights=None if lights is None else lights_object(lights),
    )
    return msgspec.json.encode(message).decode()
