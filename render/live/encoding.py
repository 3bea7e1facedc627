"""What a viewer is sent: a line of JSON, and pictures as JPEG.

One binary message: the length of the JSON as four bytes, the lowest first; the JSON; and the
pictures one after the other, whose lengths stand in it as `parts`. Whoever draws it has all of one
moment, or nothing.

Cost   : about 10 ms for 640×480 pixels and a map of 512×256, once for all viewers.
"""

from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.reduce import METHODS
from render.live.desk import Desk, LiveFrame, Notice
from render.live.models import MATERIALS
from render.output.preview import marked
from render.output.view import to_display

JPEG_QUALITY = 85


def encode_frame(frame: LiveFrame, desk: Desk) -> bytes:
    """Return the message of a moment, with the settings and notice as they are now."""
    pictures = _pictures(frame)
    encoded = {name: _jpeg(picture) for name, picture in pictures.items()}
    seen = frame.seen
    header = {
        "number": frame.number,
        "state": {"name": frame.state.name, "message": frame.state.message},
        "age_s": round(frame.age_s, 3),
        "account": frame.account,
        "parts": {name: len(jpeg) for name, jpeg in encoded.items()},
        "lights": None if seen is None else _lights(seen.lights),
        "view_ev": None if seen is None else round(seen.view_ev, 2),
        "is_draft": seen is not None and seen.is_draft,
        "settings": msgspec.to_builtins(desk.settings),
        "is_recording": desk.is_recording,
        "methods": tuple(METHODS),
        "models": desk.models.names,
        "materials": tuple(MATERIALS),
        "notice": _notice(desk.notice),
    }
    text = msgspec.json.encode(header)
    return b"".join((len(text).to_bytes(4, "little"), text, *encoded.values()))


def _pictures(frame: LiveFrame) -> dict[str, NDArray[np.uint8]]:
    seen = frame.seen
    if seen is None:
        return {}
    pictures = {}
    if seen.camera is not None:
        pictures["camera"] = marked(seen.camera, seen.view_ev, seen.camera.size_px)
    if seen.environment is not None:
        height = seen.environment.height
        pictures["map"] = marked(seen.environment, seen.view_ev, (2 * height, height))
    if seen.picture is not None:
        pictures["picture"] = to_display(seen.picture, seen.view_ev)
    return pictures


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    blue_first = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", blue_first, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()


def _lights(lights: LightSet) -> dict[str, Any]:
    """Return what a viewer draws; `fishlight follow` gets all digits of it (stream.py)."""
    return {
        "directions": np.round(lights.directions, 4).tolist(),
        "irradiance": [[float(f"{value:.4g}") for value in rgb] for rgb in lights.irradiance],
        "angular_radius_rad": np.round(lights.angular_radius_rad, 4).tolist(),
        "is_key": lights.is_key.tolist(),
        "fill_share": _fill_share(lights),
        "predicted_error": lights.predicted_error,
        "clipped_fraction": round(lights.clipped_fraction, 4),
        "scale": lights.scale,
    }


def _fill_share(lights: LightSet) -> float:
    """Return the share of all light that the fill holds."""
    total = float(lights.integral().sum())
    return 1.0 - float(lights.irradiance.sum()) / total if total > 0 else 0.0


def _notice(notice: Notice | None) -> dict[str, Any] | None:
    if notice is None:
        return None
    return {"number": notice.number, "text": notice.text, "is_error": notice.is_error}
