"""Brings a camera under manual control: automatics off, gain and white balance fixed.

Input  : VideoNode and its controls.    Output : ExposureControl, exposure times in seconds.
Fails  : uvcvideo answers many reads from its own memory, not from the camera; what is in the
         pictures is checked in `capture.v4l2.settling` and `capture.v4l2.consistency`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor

from capture.errors import InputError
from capture.v4l2 import kernel
from capture.v4l2.controls import Control, menu_entries, read_control, write_control
from capture.v4l2.node import VideoNode

# Numbers of linux/v4l2-controls.h.
_EXPOSURE_AUTO, _MANUAL = 0x9A0901, 1
_EXPOSURE_ABSOLUTE, _EXPOSURE_LINES = 0x9A0902, 0x980911
_GAIN, _ANALOGUE_GAIN, _DIGITAL_GAIN = 0x980913, 0x9E0903, 0x9F0905
_WHITE_BALANCE_TEMPERATURE = 0x98091A
_HORIZONTAL_BLANKING, _PIXEL_RATE = 0x9E0902, 0x9F0902

_AUTOMATICS = (
    (_EXPOSURE_AUTO, _MANUAL),  # first: while it is on, others cannot be set
    (0x9A0903, 0),  # EXPOSURE_AUTO_PRIORITY: the frame rate follows the light
    (0x98090C, 0),  # AUTO_WHITE_BALANCE
    (0x9A0914, 0),  # AUTO_N_PRESET_WHITE_BALANCE
    (0x980912, 0),  # AUTOGAIN
    (0x9A0918, 0),  # ISO_SENSITIVITY_AUTO
    (0x980920, 0),  # AUTOBRIGHTNESS
    (0x980919, 0),  # HUE_AUTO
    (0x98091C, 0),  # BACKLIGHT_COMPENSATION
    (0x9A0915, 0),  # WIDE_DYNAMIC_RANGE
    (0x9A090C, 0),  # FOCUS_AUTO: it moves the lens, and the calibration with it
)
"""Controls that change pictures by themselves, and the value at which they do not."""

_DAYLIGHT_K = 6500
"""D65, the white of radiance here."""

_ABSOLUTE_UNIT_S = 1e-4


@dataclass(frozen=True)
class ExposureControl:
    """A camera's exposure time in seconds: `unit_s` times its control's value."""

    node: VideoNode
    control: Control
    unit_s: float

    def nearest(self, time_s: float) -> float:
        """Return the exposure time nearest to `time_s` that the control can hold."""
        return self.control.nearest(time_s / self.unit_s) * self.unit_s

    def set(self, time_s: float) -> float:
        """Set the nearest exposure time, and return the one that the camera then says it has."""
        value = self.control.nearest(time_s / self.unit_s)
        return write_control(self.node, self.control, value) * self.unit_s

    def range_within(self, interval_s: float) -> tuple[float, float]:
        """Return the shortest exposure that is not 0, and the longest that fits between two frames.

        Raises
        ------
        InputError
            If there is no choice between them.
        """
        control = self.control
        least = control.minimum if control.minimum > 0 else control.nearest(max(control.step, 1))
        most = control.nearest(min(floor(interval_s / self.unit_s), control.maximum))
        if most <= least:
            raise InputError(
                f"{_name(self.node, control)} goes from {least * self.unit_s:.3g} s, which leaves "
                f"no choice at {1 / interval_s:.3g} frames a second"
            )
        return least * self.unit_s, most * self.unit_s


def take_control(
    node: VideoNode, controls: Mapping[int, Control], width_px: int
) -> ExposureControl:
    """Turn a camera's automatics off, fix gain and white balance, and return its exposure.

    Gain goes to its least, which keeps the most light below saturation, and the white balance to
    daylight; each is read back. The power-line frequency is left alone: it acts on automatic
    exposure.

    Raises
    ------
    InputError
        If an automatic stays on, naming it, or there is no exposure time in known units.
    """
    for number, off in _AUTOMATICS:
        if number in controls:
            _turn_off(node, controls[number], off)
    for number in (_GAIN, _ANALOGUE_GAIN):
        if number in controls:
            _fix(node, controls[number], controls[number].minimum)
    if _DIGITAL_GAIN in controls:  # its least darkens, below full scale
        _fix(node, controls[_DIGITAL_GAIN], controls[_DIGITAL_GAIN].default)
    if _WHITE_BALANCE_TEMPERATURE in controls:
        temperature = controls[_WHITE_BALANCE_TEMPERATURE]
        _fix(node, temperature, temperature.nearest(_DAYLIGHT_K))
    return _exposure_control(node, controls, width_px)


def _turn_off(node: VideoNode, control: Control, off: int) -> None:
    if control.kind == kernel.MENU and off not in menu_entries(node, control):
        raise InputError(f"{_name(node, control)} cannot be turned off: it has no manual mode")
    # Some cameras refuse to set what depends on a mode that is off already.
    if read_control(node, control) == off:
        return
    if control.is_read_only:
        raise InputError(f"{_name(node, control)} is on and cannot be turned off")
    got = write_control(node, control, off)
    if got != off:
        raise InputError(
            f"{_name(node, control)} stays on (set to {off}, it reads {got}); with it on, frames "
            "of one bracket cannot be compared"
        )


def _fix(node: VideoNode, control: Control, value: int) -> None:
    if control.is_read_only or read_control(node, control) == value:
        return
    got = write_control(node, control, value)
    if got != value:
        raise InputError(f"{_name(node, control)} was set to {value} and reads {got}")


def _exposure_control(
    node: VideoNode, controls: Mapping[int, Control], width_px: int
) -> ExposureControl:
    if _EXPOSURE_ABSOLUTE in controls:
        return ExposureControl(node, controls[_EXPOSURE_ABSOLUTE], _ABSOLUTE_UNIT_S)
    if _EXPOSURE_LINES not in controls:
        raise InputError(f"{node.path} ({node.card}): has no control of its exposure time")
    exposure = controls[_EXPOSURE_LINES]
    timing = [controls.get(number) for number in (_HORIZONTAL_BLANKING, _PIXEL_RATE)]
    if None in timing:
        raise InputError(
            f"{_name(node, exposure)} counts lines of unknown duration: the camera tells neither "
            "its pixel rate nor its blanking here"
        )
    blanking_px, rate_hz = (read_control(node, control) for control in timing if control)
    return ExposureControl(node, exposure, (width_px + blanking_px) / rate_hz)


def _name(node: VideoNode, control: Control) -> str:
    return f"{node.path} ({node.card}): '{control.name}'"
