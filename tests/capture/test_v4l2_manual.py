"""Automatics go off, in the right order and read back, or the camera is refused by name."""

from typing import Any

import pytest

from capture.errors import InputError
from capture.v4l2 import kernel
from capture.v4l2.controls import (
    Control,
    list_controls,
    menu_entries,
    read_control,
    write_control,
)
from capture.v4l2.manual import ExposureControl, take_control
from tests.capture.simulated_node import (
    BLANKING,
    EXPOSURE,
    EXPOSURE_AUTO,
    EXPOSURE_LINES,
    GAIN,
    PIXEL_RATE,
    PRIORITY,
    WHITE_BALANCE,
    WHITE_BALANCE_AUTO,
    SimulatedControl,
    SimulatedNode,
)


def take(node: Any, width_px: int = 640) -> ExposureControl:
    return take_control(node, list_controls(node), width_px)


def control_of(node: Any, number: int) -> Control:
    return list_controls(node)[number]


def test_automatics_go_off_manual_exposure_first_and_all_is_fixed() -> None:
    node = SimulatedNode()
    take(node)
    assert node.written[:2] == [(EXPOSURE_AUTO, 1), (PRIORITY, 0)]
    values = {control.number: control.value for control in node.controls}
    assert values[WHITE_BALANCE_AUTO] == 0
    assert values[GAIN] == 4  # its least
    assert values[WHITE_BALANCE] == 6300  # the nearest to 6500 K


def test_what_is_off_already_is_not_touched() -> None:
    """Some cameras refuse to set what depends on a mode that is off."""
    node = SimulatedNode()
    node.control(PRIORITY).value = 0
    node.control(GAIN).value = 4
    take(node)
    assert not {PRIORITY, GAIN} & {number for number, _ in node.written}


@pytest.mark.parametrize(
    ("number", "name"),
    [
        (WHITE_BALANCE_AUTO, "White Balance, Automatic"),
        (PRIORITY, "Exposure, Dynamic Framerate"),
        (EXPOSURE_AUTO, "Auto Exposure"),
    ],
)
def test_an_automatic_that_stays_on_is_refused_by_name(number: int, name: str) -> None:
    node = SimulatedNode()
    control = node.control(number)
    on = control.value
    control.keeps = lambda value: on
    with pytest.raises(InputError, match=f"/dev/video7.*'{name}' stays on"):
        take(node)


def test_an_automatic_that_cannot_be_set_is_refused_by_name() -> None:
    node = SimulatedNode()
    node.control(WHITE_BALANCE_AUTO).flags = kernel.CONTROL_READ_ONLY
    with pytest.raises(InputError, match="'White Balance, Automatic' is on and cannot be turned"):
        take(node)
    node = SimulatedNode()
    del node.control(EXPOSURE_AUTO).menu[1]
    with pytest.raises(InputError, match="'Auto Exposure' cannot be turned off: it has no manual"):
        take(node)


def test_a_gain_that_does_not_keep_is_refused_by_name() -> None:
    node = SimulatedNode()
    node.control(GAIN).keeps = lambda value: value + 1
    with pytest.raises(InputError, match="'Gain' was set to 4 and reads 5"):
        take(node)


def test_exposure_is_in_units_of_a_tenth_of_a_millisecond_and_read_back() -> None:
    node = SimulatedNode()
    exposure = take(node)
    assert exposure.set(0.01) == pytest.approx(0.01)
    assert node.written[-1] == (EXPOSURE, 100)
    node.control(EXPOSURE).keeps = lambda value: value + 3
    assert exposure.set(0.01) == pytest.approx(0.0103)
    assert exposure.nearest(0.01004) == pytest.approx(0.01)
    assert exposure.nearest(1e-9) == pytest.approx(0.0001)
    assert exposure.nearest(99.0) == pytest.approx(0.5)


def test_exposure_in_automatic_mode_is_refused_with_the_reason() -> None:
    node: Any = SimulatedNode()
    with pytest.raises(InputError, match=r"'Exposure Time, Absolute' to 100.*automatic mode holds"):
        write_control(node, control_of(node, EXPOSURE), 100)


def test_lines_are_seconds_if_the_sensor_tells_its_timing() -> None:
    """A line of 1920 + 280 pixels at 148.5 MHz takes 14.81 µs."""
    lines = SimulatedControl(EXPOSURE_LINES, "Exposure", 4, 1100, 500)
    timing = [
        SimulatedControl(BLANKING, "Horizontal Blanking", 280, 280, 280, flags=4),
        SimulatedControl(
            PIXEL_RATE, "Pixel Rate", 0, 10**12, 148_500_000, kind=kernel.INTEGER64, flags=4
        ),
    ]
    exposure = take(SimulatedNode([lines, *timing]), width_px=1920)
    assert exposure.unit_s == pytest.approx(14.8148e-6, rel=1e-5)
    assert exposure.nearest(0.005) == pytest.approx(0.005, abs=7.5e-6)
    with pytest.raises(InputError, match="'Exposure' counts lines of unknown duration"):
        take(SimulatedNode([lines, timing[0]]))
    with pytest.raises(InputError, match="has no control of its exposure time"):
        take(SimulatedNode([]))


def test_controls_are_listed_with_their_kinds_and_disabled_ones_left_out() -> None:
    node: Any = SimulatedNode()
    node.control(GAIN).flags = kernel.CONTROL_DISABLED
    controls = list_controls(node)
    assert GAIN not in controls
    assert controls[WHITE_BALANCE] == Control(
        WHITE_BALANCE, "White Balance Temperature", kernel.INTEGER, 2800, 6300, 50, 6300, False
    )


def test_values_of_32_and_64_bits_and_below_zero_are_read_whole() -> None:
    large, below = 148_500_000_000, -3
    node: Any = SimulatedNode(
        [
            SimulatedControl(PIXEL_RATE, "Pixel Rate", 0, 10**12, large, kind=kernel.INTEGER64),
            SimulatedControl(GAIN, "Gain", -8, 8, below),
        ]
    )
    assert read_control(node, control_of(node, PIXEL_RATE)) == large
    assert read_control(node, control_of(node, GAIN)) == below
    assert write_control(node, control_of(node, GAIN), -5) == -5


def test_menus_tell_only_the_entries_that_the_camera_has() -> None:
    node: Any = SimulatedNode()
    entries = menu_entries(node, control_of(node, EXPOSURE_AUTO))
    assert entries == {1: "Manual Mode", 3: "Aperture Priority Mode"}
    number = 42
    values = {0: (100).to_bytes(8, "little"), 1: (-7).to_bytes(8, "little", signed=True)}
    menu = SimulatedControl(number, "ISO", 0, 2, 0, kind=kernel.INTEGER_MENU, menu=values)
    node = SimulatedNode([menu])
    assert menu_entries(node, control_of(node, number)) == {0: 100, 1: -7}


@pytest.mark.parametrize(("wanted", "nearest"), [(-9, 2), (2.9, 2), (4.1, 5), (9, 8), (99, 8)])
def test_nearest_keeps_to_the_steps_within_the_range(wanted: float, nearest: int) -> None:
    """From 2 to 10 in steps of 3: 2, 5, 8."""
    control = Control(1, "c", kernel.INTEGER, 2, 10, 3, 2, False)
    assert control.nearest(wanted) == nearest
