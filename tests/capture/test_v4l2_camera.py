"""The camera as a whole, on a simulated node and stream: GREY pictures of 16 × 16 px."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

import capture.v4l2.camera
from capture.errors import CameraLost, CameraStalled, InputError, UnreadableFrame
from capture.merge import merge_bracket
from capture.v4l2.camera import CameraRequest, open_camera
from capture.v4l2.stream import Delivery
from tests.capture.camera_rig import TIMES_S, Rig
from tests.capture.simulated_camera import SCENE
from tests.capture.simulated_node import EXPOSURE, GAIN


def test_a_camera_is_opened_under_control_and_tells_what_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        assert (camera.name, camera.pixel_format, camera.size_px) == (
            "Test camera",
            "GREY",
            (16, 16),
        )
        assert camera.frame_interval_s == pytest.approx(1 / 30)
        assert camera.exposure_range_s == pytest.approx((0.0001, 0.0333))  # of 33.3 ms a frame
        assert camera.exposure_step_s == pytest.approx(0.0001)
        assert camera.nearest_exposure(0.00234) == pytest.approx(0.0023)
        assert camera.nearest_exposure(1.0) == pytest.approx(0.0333)
        assert camera.sensor.source == "assumed sRGB"
        assert rig.node.control(GAIN).value == 4
        assert (camera.driver, camera.read_controls()["Gain"]) == ("simulated", 4)
        assert rig.mislabelled(camera, 20) == 0
    assert (rig.stream.closed, rig.node.closed) == (1, 1)


def test_white_lies_above_a_count_that_was_seen_before(monkeypatch: pytest.MonkeyPatch) -> None:
    Rig(monkeypatch)
    brightest = []
    real = capture.v4l2.camera.pixel_sensor
    monkeypatch.setattr(
        capture.v4l2.camera,
        "pixel_sensor",
        lambda picture, brightest_dn: brightest.append(brightest_dn) or real(picture, brightest_dn),
    )
    open_camera(CameraRequest("0", seen_dn=3000)).close()
    assert brightest == [3000]


def test_a_bracket_merges_to_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        brackets = [camera.capture(TIMES_S) for _ in range(2)]
    assert [bracket.index for bracket in brackets] == [0, 1]
    picture = merge_bracket(brackets[1], camera.sensor)
    radiance = picture.radiance[..., 1].ravel()
    seen = (SCENE * TIMES_S[0] < 0.9) & (SCENE * TIMES_S[2] > 0.02)
    # Rounding to 8 bits moves a dark sRGB count by up to 3 %.
    np.testing.assert_allclose(radiance[seen], SCENE[seen], rtol=0.03)


@pytest.mark.parametrize("change_frames", [-1, 1, 2])
def test_a_delay_that_changes_is_caught_by_the_pixels_and_measured_again(
    monkeypatch: pytest.MonkeyPatch, change_frames: int
) -> None:
    """By timestamps alone every label would be wrong from then on."""
    rig = Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        assert rig.mislabelled(camera, 3) == 0
        before_s = camera.settling.latest_s
        rig.stream.delay_s += change_frames / 30
        with pytest.raises(UnreadableFrame, match="contradict their exposures"):
            rig.mislabelled(camera, 10)
        assert camera.counters.contradictions == 2
        assert camera.settling.latest_s - before_s == pytest.approx(change_frames / 30, abs=0.008)
        assert rig.mislabelled(camera, 10) == 0


def test_a_camera_that_stops_following_while_it_runs_is_stalled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As one that has gone back to automatic exposure: opening it again sets its controls."""
    rig = Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        camera.capture(TIMES_S)
        monkeypatch.setattr(rig.stream, "set_exposure", lambda time_s: time_s)
        with pytest.raises(CameraStalled, match="no longer follows its exposures"):
            rig.mislabelled(camera, 5)


def test_light_that_changes_within_a_bracket_costs_a_bracket_not_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An eighth of the light from the second exposure on looks like a wrong label, once."""
    rig = Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        camera.capture(TIMES_S)
        dim = rig.stream.look
        changes_at = camera.counters.frames + 1
        monkeypatch.setattr(
            rig.stream,
            "look",
            lambda data: dim(data) // (8 if camera.counters.frames > changes_at else 1),
        )
        camera.capture(TIMES_S)
        camera.capture(TIMES_S)
    assert camera.counters.contradictions == 1


@pytest.mark.parametrize(
    ("fault", "error"),
    [({"silent_s": 1000.2}, CameraStalled), ({"unplugged_s": 1002.0}, CameraLost)],
)
def test_a_camera_that_fails_while_it_is_opened_is_closed(
    monkeypatch: pytest.MonkeyPatch, fault: dict[str, float], error: type[Exception]
) -> None:
    rig = Rig(monkeypatch, **fault)
    with pytest.raises(error):
        open_camera(CameraRequest("0"))
    assert (rig.stream.closed, rig.node.closed) == (1, 1)


@pytest.mark.parametrize("is_garbage", [lambda number: number == 0, lambda number: number % 3 == 0])
def test_a_camera_whose_first_frames_are_garbage_is_opened_all_the_same(
    monkeypatch: pytest.MonkeyPatch, is_garbage: Callable[[int], bool]
) -> None:
    """Many cameras begin with half a JPEG."""
    rig = Rig(monkeypatch)
    send_jpegs(rig, monkeypatch, is_garbage)
    with open_camera(CameraRequest("0", pixel_format="MJPG")) as camera:
        assert camera.settling.earliest_s <= rig.stream.delay_s <= camera.settling.latest_s


def test_a_camera_that_sends_nothing_but_garbage_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(monkeypatch)
    send_jpegs(rig, monkeypatch, lambda number: True)
    with pytest.raises(CameraStalled, match=r"40 damaged frames .* the frame's JPEG is"):
        open_camera(CameraRequest("0", pixel_format="MJPG"))
    assert (rig.stream.closed, rig.node.closed) == (1, 1)


def send_jpegs(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, is_garbage: Callable[[int], bool]
) -> None:
    """Let the stream send MJPG, some of its frames cut after a few bytes, by their number."""
    rig.node.formats = {"MJPG": [(16, 16)]}
    grey = rig.stream.next_frame

    def next_frame(timeout_s: float) -> Delivery | None:
        delivery = grey(timeout_s)
        if delivery is None:
            return None
        pixels = np.frombuffer(delivery.data, np.uint8).reshape(16, 16)
        jpeg = cv2.imencode(".jpg", pixels)[1].tobytes()
        end = 40 if is_garbage(delivery.sequence) else len(jpeg)
        return replace(delivery, data=jpeg[:end])

    monkeypatch.setattr(rig.stream, "next_frame", next_frame)


def test_what_cannot_be_run_is_refused_and_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    with pytest.raises(InputError, match="odd"):
        open_camera(CameraRequest("0", size_px=(15, 16)))
    rig.node.control(EXPOSURE).minimum = 400
    with pytest.raises(InputError, match=r"goes from 0\.04 s, which leaves no choice at 30 frames"):
        open_camera(CameraRequest("0"))
    assert rig.node.closed == 2


def test_a_bracket_of_nothing_and_exposures_of_nothing_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        for times_s in ([], [0.0], [0.01, -1.0], [float("nan")]):
            with pytest.raises(InputError, match=r"at least one exposure|must be above 0 s"):
                camera.capture(times_s)


def test_a_machine_that_was_too_busy_to_prove_the_delay_measures_it_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    proofs = iter([UnreadableFrame("busy")])
    collect = capture.v4l2.camera.ExposureCycle.collect

    def upset(cycle: Any, times_s: Any) -> Any:
        if (error := next(proofs, None)) is not None:
            raise error
        return collect(cycle, times_s)

    monkeypatch.setattr(capture.v4l2.camera.ExposureCycle, "collect", upset)
    rig = Rig(monkeypatch)
    with open_camera(CameraRequest("0")) as camera:
        assert rig.mislabelled(camera, 10) == 0


def test_frames_that_never_follow_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exposed the other way round once the delay is measured: no delay explains that."""
    rig = Rig(monkeypatch)
    monkeypatch.setattr(capture.v4l2.camera, "_rises", lambda proof: False)
    with pytest.raises(InputError, match="do not follow its exposures with a delay"):
        open_camera(CameraRequest("0"))
    assert rig.node.closed == 1
