"""What can be changed while a session runs, and how a change asked for from outside is judged.

Domain : every field has a range; whatever lies outside is refused whole, with the field's name.
"""

from collections.abc import Mapping
from math import pi
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from capture.errors import InputError
from lighting.methods.adaptive import MOST_LIGHTS_FOR_ERROR
from lighting.reduce import ADAPTIVE, METHODS
from lighting.stream.light_stream import LightPlan

MOST_LIGHTS = 512
"""More are not drawn live."""

_Metres = Annotated[float, Meta(ge=-1000, le=1000)]
_Seconds = Annotated[float, Meta(ge=1e-6, le=100.0)]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The state of every control.

    Attributes
    ----------
    method : str
        A key of `lighting.reduce.METHODS`.
    is_auto : bool
        Whether `error` says how many lights there are, in place of `count`. Only the adaptive
        method can; any other takes `count`.
    count : int
    error : float
    frame_rate_hz : float or None
        To be held, with fewer lights and smaller pictures where that is needed.
    is_steady : bool
    exposures_s : tuple of float or None
        Of a camera's brackets; None chooses them.
    view_ev : float or None
        Exposure of what is shown; None chooses it.
    yaw_rad : float
        Turn of the light about the vertical, counter-clockwise seen from above.
    is_frozen : bool
        Whether the light stays as it is.
    model, material : str
        Of the scene: names that live.models knows.
    is_background : bool
        Whether the scene stands in what the camera sees, on its floor.
    azimuth_rad, elevation_rad, distance : float
        Where the viewer stands: 1 is the distance at which the scene fills the picture.
    x_m, y_m, z_m : float
        Where the scene stands among the cameras of a blend.
    """

    method: str = ADAPTIVE
    is_auto: bool = False
    count: Annotated[int, Meta(ge=1, le=MOST_LIGHTS)] = 64
    error: Annotated[float, Meta(ge=0.005, le=0.5)] = 0.05
    frame_rate_hz: Annotated[float, Meta(ge=1, le=120)] | None = None
    is_steady: bool = True
    exposures_s: Annotated[tuple[_Seconds, ...], Meta(min_length=1, max_length=8)] | None = None
    view_ev: Annotated[float, Meta(ge=-30, le=30)] | None = None
    yaw_rad: Annotated[float, Meta(ge=-pi, le=pi)] = 0.0
    is_frozen: bool = False
    model: Annotated[str, Meta(max_length=80)] = "objects"
    material: Annotated[str, Meta(max_length=80)] = "own"
    is_background: bool = True
    azimuth_rad: Annotated[float, Meta(ge=-pi, le=pi)] = -pi + pi / 9
    elevation_rad: Annotated[float, Meta(ge=-0.2, le=1.5)] = pi / 15
    distance: Annotated[float, Meta(ge=0.3, le=4.0)] = 1.0
    x_m: _Metres = 0.0
    y_m: _Metres = 0.0
    z_m: _Metres = 0.0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"no method is called {self.method!r}")


def changed(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Return the settings with some fields changed.

    Raises
    ------
    InputError
        If a field is unknown, of another type, or out of its range; none is changed then.
    """
    fields = msgspec.to_builtins(settings)
    try:
        return msgspec.convert({**fields, **changes}, Settings)
    except msgspec.ValidationError as error:
        raise InputError(f"not changed: {error}") from None


def light_plan(settings: Settings) -> LightPlan:
    """Return what lights each frame is to have, whatever time they take."""
    if not settings.is_auto or settings.method != ADAPTIVE:
        return LightPlan(settings.count, settings.method, is_steady=settings.is_steady)
    return LightPlan(MOST_LIGHTS_FOR_ERROR, error=settings.error, is_steady=settings.is_steady)
