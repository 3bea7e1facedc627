"""The controls of a USB camera, and its answers to requests about them (USB Video Class 1.1)."""

import struct
import time
from dataclasses import dataclass, field

from tests.camera.uvc_descriptors import CAMERA_TERMINAL, PROCESSING_UNIT

SET_CUR = 0x01
GET_CUR, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF = range(0x81, 0x88)

MANUAL, APERTURE_PRIORITY = 1, 8
"""Auto-exposure modes: the second lets the camera choose the exposure time."""

_REQUEST_ERROR_CODE = 2
_WRONG_STATE, _OUT_OF_RANGE, _NO_SUCH_CONTROL = 2, 4, 6
_READABLE_WRITABLE, _CHANGES_ITSELF = 3, 8


@dataclass
class _Control:
    form: str
    least: int
    most: int
    value: int
    step: int = 1
    changes_itself: bool = False
    initial: int = field(init=False)

    def __post_init__(self) -> None:
        self.initial = self.value

    def packed(self, value: int) -> bytes:
        return struct.pack("<" + self.form, value)


_NAMES = {
    (CAMERA_TERMINAL, 2): "exposure_mode",
    (CAMERA_TERMINAL, 3): "exposure_slows_stream",
    (CAMERA_TERMINAL, 4): "exposure",
    (PROCESSING_UNIT, 2): "brightness",
    (PROCESSING_UNIT, 4): "gain",
    (PROCESSING_UNIT, 5): "power_line",
    (PROCESSING_UNIT, 10): "white_balance",
    (PROCESSING_UNIT, 11): "white_balance_auto",
}


@dataclass(frozen=True)
class Settings:
    """The values of all controls at one moment; `exposure` in units of 100 µs."""

    exposure_mode: int
    exposure_slows_stream: int
    exposure: int
    brightness: int
    gain: int
    power_line: int
    white_balance: int
    white_balance_auto: int


class Controls:
    """A camera's controls as they stand; everything automatic is on at first.

    `exposures` are the times that the camera can do, in units of 100 µs: another one is accepted
    and rounded to the nearest, as many webcams do, and read back as what it became.
    `changes` holds (time, name, value) of everything set.
    """

    def __init__(self, exposures: tuple[int, ...], gain_count: int) -> None:
        self._exposures = exposures
        self._error = 0
        self.changes: list[tuple[float, str, int]] = []
        middle = exposures[len(exposures) // 2]
        self._controls = {
            "exposure_mode": _Control("B", 1, 8, APERTURE_PRIORITY, MANUAL | APERTURE_PRIORITY),
            "exposure_slows_stream": _Control("B", 0, 1, 1),
            "exposure": _Control("I", exposures[0], exposures[-1], middle, changes_itself=True),
            "brightness": _Control("h", -64, 64, 0),
            "gain": _Control("H", 0, gain_count - 1, 0),
            "power_line": _Control("B", 0, 2, 1),
            "white_balance": _Control("H", 2800, 6500, 4600),
            "white_balance_auto": _Control("B", 0, 1, 1),
        }

    def settings(self) -> Settings:
        """Return the present values."""
        return Settings(**{name: control.value for name, control in self._controls.items()})

    def answer(self, request: int, entity: int, selector: int, data: bytes) -> bytes | None:
        """Return the answer to a request; None refuses it, and the reason can be asked for."""
        if entity == 0:
            return bytes([self._error]) if selector == _REQUEST_ERROR_CODE else None
        name = _NAMES.get((entity, selector))
        if name is None:
            self._error = _NO_SUCH_CONTROL
            return None
        control = self._controls[name]
        if request == SET_CUR:
            self._error = self._set(name, struct.unpack_from("<" + control.form, data)[0])
            return None if self._error else b""
        self._error = 0
        info = _READABLE_WRITABLE | (_CHANGES_ITSELF if control.changes_itself else 0)
        return {
            GET_CUR: control.packed(control.value),
            GET_MIN: control.packed(control.least),
            GET_MAX: control.packed(control.most),
            GET_RES: control.packed(control.step),
            GET_DEF: control.packed(control.initial),
            GET_LEN: struct.pack("<H", struct.calcsize("<" + control.form)),
            GET_INFO: bytes([info]),
        }.get(request)

    def _set(self, name: str, value: int) -> int:
        """Return the error code, 0 if the value was accepted."""
        control = self._controls[name]
        if name == "exposure" and self._controls["exposure_mode"].value != MANUAL:
            return _WRONG_STATE
        if not control.least <= value <= control.most:
            return _OUT_OF_RANGE
        if name == "exposure_mode" and value not in (MANUAL, APERTURE_PRIORITY):
            return _OUT_OF_RANGE
        if name == "exposure":
            value = min(self._exposures, key=lambda exposure: abs(exposure - value))
        control.value = value
        self.changes.append((time.monotonic(), name, value))
        return 0
