"""A camera's controls: listed, read, and written with what they really became read back.

Input  : VideoNode.    Output : Control by number, values as Python integers.
"""

import ctypes
import errno
from contextlib import suppress
from dataclasses import dataclass

from capture.errors import InputError
from capture.v4l2 import kernel
from capture.v4l2.node import VideoNode, device_text

_VALUED = frozenset(
    (kernel.INTEGER, kernel.BOOLEAN, kernel.MENU, kernel.INTEGER64, kernel.INTEGER_MENU)
)


@dataclass(frozen=True)
class Control:
    """What a control is; `number` is the kernel's (V4L2_CID_…), `kind` a type of `kernel`."""

    number: int
    name: str
    kind: int
    minimum: int
    maximum: int
    step: int
    default: int
    is_read_only: bool

    def nearest(self, value: float) -> int:
        """Return the value nearest to `value` that the control can take."""
        steps = round((value - self.minimum) / self.step)
        most = (self.maximum - self.minimum) // self.step
        return self.minimum + self.step * min(max(steps, 0), most)


def list_controls(node: VideoNode) -> dict[int, Control]:
    """Return the controls that hold one number each: integers, switches and menus."""
    controls: dict[int, Control] = {}
    number = 0
    while True:
        query = kernel.ControlQuery(id=number | kernel.NEXT_CONTROL)
        try:
            node.call(kernel.QUERY_CONTROL, query, "list its controls")
        except OSError:  # EINVAL after the last one, ENOTTY where there are none
            return controls
        number = query.id
        if query.type in _VALUED and not query.flags & kernel.CONTROL_DISABLED:
            controls[number] = Control(
                number=number,
                name=device_text(query.name),
                kind=query.type,
                minimum=query.minimum,
                maximum=query.maximum,
                step=max(query.step, 1),
                default=query.default_value,
                is_read_only=bool(query.flags & kernel.CONTROL_READ_ONLY),
            )


def menu_entries(node: VideoNode, control: Control) -> dict[int, str | int]:
    """Return the entries that a menu offers, by value: their names, or numbers of an integer menu.

    A camera leaves out the entries that it does not have.
    """
    entries: dict[int, str | int] = {}
    for value in range(control.minimum, control.maximum + 1):
        query = kernel.MenuQuery(id=control.number, index=value)
        try:
            node.call(kernel.QUERY_MENU, query, f"list the entries of '{control.name}'")
        except OSError:
            continue
        raw = bytes(query)[8:40]
        if control.kind == kernel.INTEGER_MENU:
            entries[value] = int.from_bytes(raw[:8], "little", signed=True)
        else:
            entries[value] = raw.split(b"\0")[0].decode(errors="replace")
    return entries


def read_control(node: VideoNode, control: Control) -> int:
    """Return a control's present value; InputError if the camera will not tell."""
    value = kernel.ControlValue(id=control.number)
    try:
        _call(node, kernel.GET_CONTROLS, value, f"read '{control.name}'")
    except OSError as error:
        raise InputError(str(error.strerror)) from None
    return _number(control, value)


def read_controls(node: VideoNode) -> dict[str, int]:
    """Return the present values of a camera's controls by their names, of those it tells."""
    values = {}
    for control in list_controls(node).values():
        with suppress(InputError):
            values[control.name] = read_control(node, control)
    return values


def write_control(node: VideoNode, control: Control, value: int) -> int:
    """Set a control and return what the camera then says it is.

    Raises
    ------
    InputError
        If the camera refuses, naming the control: it is out of range, read-only, or held by an
        automatic.
    """
    wanted = kernel.ControlValue(id=control.number, value64=value)
    try:
        _call(node, kernel.SET_CONTROLS, wanted, f"set '{control.name}' to {value}")
    except OSError as error:
        reason = str(error.strerror)
        if error.errno in (errno.EACCES, errno.EPERM):
            reason += "; the camera does not let go of it (an automatic mode holds it)"
        elif error.errno in (errno.ERANGE, errno.EINVAL):
            reason += f"; it goes from {control.minimum} to {control.maximum}"
        raise InputError(reason) from None
    return read_control(node, control)


def _call(node: VideoNode, request: int, value: kernel.ControlValue, purpose: str) -> None:
    values = kernel.ControlValues(count=1, controls=ctypes.pointer(value))
    node.call(request, values, purpose)


def _number(control: Control, value: kernel.ControlValue) -> int:
    if control.kind == kernel.INTEGER64:
        return int(value.value64)
    return ctypes.c_int32(value.value64 & 0xFFFF_FFFF).value  # the upper half is not written
