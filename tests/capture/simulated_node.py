"""A device node that answers requests as the kernel does: controls and formats, no frames."""

import errno
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from capture.v4l2 import kernel

EXPOSURE_AUTO, EXPOSURE, PRIORITY = 0x9A0901, 0x9A0902, 0x9A0903
EXPOSURE_LINES, GAIN = 0x980911, 0x980913
WHITE_BALANCE_AUTO, WHITE_BALANCE = 0x98090C, 0x98091A
BLANKING, PIXEL_RATE = 0x9E0902, 0x9F0902


@dataclass
class SimulatedControl:
    """A control; `keeps` maps what is written to what it then is."""

    number: int
    name: str
    minimum: int
    maximum: int
    value: int
    step: int = 1
    kind: int = kernel.INTEGER
    flags: int = 0
    menu: dict[int, bytes] = field(default_factory=dict)
    keeps: Callable[[int], int] = lambda value: value


def webcam_controls() -> list[SimulatedControl]:
    """Return the controls of a usual USB camera, all its automatics on."""
    menu = {1: b"Manual Mode", 3: b"Aperture Priority Mode"}
    return [
        SimulatedControl(GAIN, "Gain", 4, 100, 50),
        SimulatedControl(WHITE_BALANCE_AUTO, "White Balance, Automatic", 0, 1, 1,
                         kind=kernel.BOOLEAN),
        SimulatedControl(WHITE_BALANCE, "White Balance Temperature", 2800, 6300, 4000, step=50),
        SimulatedControl(EXPOSURE_AUTO, "Auto Exposure", 0, 3, 3, kind=kernel.MENU, menu=menu),
        SimulatedControl(EXPOSURE, "Exposure Time, Absolute", 1, 5000, 157),
        SimulatedControl(PRIORITY, "Exposure, Dynamic Framerate", 0, 1, 1, kind=kernel.BOOLEAN),
    ]  # fmt: skip


@dataclass
class SimulatedNode:
    """Stands in for VideoNode.

    Attributes
    ----------
    written : list of (int, int)
        Every control that was set, and to what.
    formats : dict
        Sizes by four-character code, and the intervals of all of them.
    given : dict
        Members of the format that the driver changes of itself.
    """

    controls: list[SimulatedControl] = field(default_factory=webcam_controls)
    formats: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    intervals: list[tuple[int, int]] = field(default_factory=list)
    given: dict[str, int] = field(default_factory=dict)
    present: tuple[str, int, int] = ("MJPG", 640, 480)
    interval: tuple[int, int] = (1, 30)
    rate_is_settable: bool = True

    def __post_init__(self) -> None:
        self.path = Path("/dev/video7")
        self.card, self.driver = "Test camera", "simulated"
        self.written: list[tuple[int, int]] = []
        self.controls = sorted(self.controls, key=lambda control: control.number)

    def control(self, number: int) -> SimulatedControl:
        return next(control for control in self.controls if control.number == number)

    def call(self, request: int, argument: Any, purpose: str) -> None:
        answers = {
            kernel.QUERY_CONTROL: self._query_control,
            kernel.QUERY_MENU: self._query_menu,
            kernel.GET_CONTROLS: self._get_control,
            kernel.SET_CONTROLS: self._set_control,
            kernel.ENUMERATE_FORMATS: self._enumerate_formats,
            kernel.ENUMERATE_SIZES: self._enumerate_sizes,
            kernel.ENUMERATE_INTERVALS: self._enumerate_intervals,
            kernel.GET_FORMAT: self._get_format,
            kernel.SET_FORMAT: self._set_format,
            kernel.GET_PARAMETERS: self._get_parameters,
            kernel.SET_PARAMETERS: self._set_parameters,
        }
        try:
            answers[request](argument)
        except OSError as error:
            # As VideoNode tells it.
            raise OSError(error.errno, f"{self.path}: cannot {purpose}: {error}") from None

    def _query_control(self, query: kernel.ControlQuery) -> None:
        after = query.id & ~kernel.NEXT_CONTROL
        control = next((one for one in self.controls if one.number > after), None)
        if control is None:
            raise OSError(errno.EINVAL, "Invalid argument")
        query.id, query.type, query.name = control.number, control.kind, control.name.encode()
        query.minimum, query.maximum, query.step = control.minimum, control.maximum, control.step
        query.default_value, query.flags = control.maximum, control.flags

    def _query_menu(self, query: kernel.MenuQuery) -> None:
        menu = self.control(query.id).menu
        if query.index not in menu:
            raise OSError(errno.EINVAL, "Invalid argument")
        query.name = menu[query.index]

    def _get_control(self, values: kernel.ControlValues) -> None:
        control = self.control(values.controls[0].id)
        if control.kind == kernel.INTEGER64:
            values.controls[0].value64 = control.value
        else:  # the kernel writes 32 bits
            values.controls[0].value64 = 0x7777_7777 << 32 | control.value & 0xFFFF_FFFF

    def _set_control(self, values: kernel.ControlValues) -> None:
        control, value = self.control(values.controls[0].id), values.controls[0].value64
        is_automatic = EXPOSURE_AUTO in [one.number for one in self.controls]
        if control.number == EXPOSURE and is_automatic and self.control(EXPOSURE_AUTO).value != 1:
            raise OSError(errno.EACCES, "Permission denied")
        if not control.minimum <= value <= control.maximum:
            raise OSError(errno.ERANGE, "Numerical result out of range")
        self.written.append((control.number, value))
        control.value = control.keeps(value)

    def _enumerate_formats(self, query: kernel.FormatDescription) -> None:
        query.pixelformat = kernel.fourcc(_item(list(self.formats), query.index))

    def _enumerate_sizes(self, query: kernel.FrameSize) -> None:
        sizes = self.formats[kernel.fourcc_name(query.pixel_format)]
        query.type = kernel.DISCRETE
        query.values[0], query.values[1] = _item(sizes, query.index)

    def _enumerate_intervals(self, query: kernel.FrameInterval) -> None:
        query.type = kernel.DISCRETE
        query.values[0], query.values[1] = _item(self.intervals, query.index)

    def _get_format(self, answer: kernel.Format) -> None:
        name, answer.width, answer.height = self.present
        answer.pixelformat = kernel.fourcc(name)

    def _set_format(self, answer: kernel.Format) -> None:
        """Take the nearest size, as drivers do."""
        sizes = self.formats[kernel.fourcc_name(answer.pixelformat)]
        nearest = min(sizes, key=lambda size: abs(size[0] - answer.width))
        answer.width, answer.height = nearest
        answer.bytesperline, answer.field = 2 * answer.width + 32, kernel.FIELD_NONE
        for name, value in self.given.items():
            setattr(answer, name, value)

    def _get_parameters(self, answer: kernel.StreamParameters) -> None:
        answer.capability = kernel.HAS_FRAME_INTERVAL if self.rate_is_settable else 0
        answer.numerator, answer.denominator = self.interval

    def _set_parameters(self, answer: kernel.StreamParameters) -> None:
        wanted = answer.numerator / answer.denominator
        self.interval = min(self.intervals, key=lambda one: abs(one[0] / one[1] - wanted))
        answer.numerator, answer.denominator = self.interval


def _item(values: list[Any], index: int) -> Any:
    if index >= len(values):
        raise OSError(errno.EINVAL, "Invalid argument")
    return values[index]
