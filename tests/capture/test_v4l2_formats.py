"""What is asked for is what the driver gives, or the camera is refused with what it offers."""

from typing import Any

import pytest

from capture.errors import InputError
from capture.v4l2 import kernel
from capture.v4l2.formats import PictureFormat, choose_format, choose_interval
from tests.capture.simulated_node import SimulatedNode

SUPPORTED = {"YUYV", "MJPG"}
OFFERED = {"H264": [(1920, 1080)], "YUYV": [(640, 480), (320, 240)], "MJPG": [(1280, 720)]}


def node(**changes: Any) -> Any:
    return SimulatedNode(formats=OFFERED, intervals=[(1, 30), (1, 15)], **changes)


def test_the_format_is_what_the_driver_gave() -> None:
    given = {"colorspace": 3, "ycbcr_enc": 2, "quantization": 1, "xfer_func": 1}
    picture = choose_format(node(given=given), "YUYV", (320, 240), SUPPORTED)
    assert picture == PictureFormat("YUYV", (320, 240), 672, 3, 2, 1, 1)


def test_what_is_not_asked_for_stays_or_is_the_first_that_can_be_used() -> None:
    assert choose_format(node(), None, None, SUPPORTED).fourcc == "MJPG"
    assert choose_format(node(present=("H264", 640, 480)), None, None, SUPPORTED) == PictureFormat(
        "YUYV", (640, 480), 1312
    )


@pytest.mark.parametrize(
    ("fourcc", "size_px", "message"),
    [
        ("GREY", None, "wanted pixel format GREY; the camera offers H264, YUYV, MJPG"),
        ("H264", None, "wanted pixel format H264.*of which YUYV, MJPG can be used"),
        ("YUYV", (800, 600), "wanted YUYV 800×600, the driver gave.*comes in 640×480, 320×240"),
    ],
)
def test_what_is_not_offered_is_refused_with_what_is(
    fourcc: str, size_px: tuple[int, int] | None, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        choose_format(node(), fourcc, size_px, SUPPORTED)


def test_a_driver_that_gives_another_format_than_it_offers_is_refused() -> None:
    given = {"pixelformat": kernel.fourcc("MJPG")}
    with pytest.raises(InputError, match="wanted YUYV 640×480, the driver gave MJPG 640×480"):
        choose_format(node(given=given), "YUYV", None, SUPPORTED)


def test_half_pictures_are_refused() -> None:
    with pytest.raises(InputError, match="interlaced"):
        choose_format(node(given={"field": 4}), "YUYV", None, SUPPORTED)


def test_the_rate_is_the_highest_or_the_one_asked_for_or_refused() -> None:
    picture = PictureFormat("YUYV", (640, 480), 1280)
    assert choose_interval(node(), picture, None) == pytest.approx(1 / 30)
    assert choose_interval(node(), picture, 15) == pytest.approx(1 / 15)
    assert choose_interval(node(), picture, 29.97) == pytest.approx(1 / 30)
    with pytest.raises(InputError, match=r"wanted 25 frames a second.*gave 30; YUYV.*at 30, 15"):
        choose_interval(node(), picture, 25)
    fixed = node(rate_is_settable=False, interval=(1, 10))
    assert choose_interval(fixed, picture, None) == pytest.approx(1 / 10)
    with pytest.raises(InputError, match="wanted 30 frames a second, the driver gave 10"):
        choose_interval(fixed, picture, 30)


@pytest.mark.parametrize("rate_hz", [0.0, -30.0, float("nan"), float("inf")])
def test_a_rate_that_is_none_is_refused(rate_hz: float) -> None:
    with pytest.raises(InputError, match="frame rate must be above 0"):
        choose_interval(node(), PictureFormat("YUYV", (640, 480), 1280), rate_hz)
