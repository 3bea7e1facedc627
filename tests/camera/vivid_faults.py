"""The streaming layer against errors that the kernel's virtual camera injects: make test-camera.

Collected only there: it costs a guest of its own, and the emulated camera's tests find most of
what it finds.
"""

import json
from itertools import pairwise
from typing import Any

import pytest

from tests.camera.required_guest import run_schedule
from tests.camera.vivid_schedule import FRAMES

pytestmark = pytest.mark.camera

VIVID = "vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0"
"""One webcam, and nothing that puts pictures out."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    share = tmp_path_factory.mktemp("vivid")
    run_schedule("vivid_schedule", share, [VIVID])
    found: dict[str, Any] = json.loads((share / "report.json").read_text())
    return found


def gaps(sequences: list[int]) -> list[int]:
    return [later - earlier - 1 for earlier, later in pairwise(sequences)]


def test_camera_without_exposure_time_is_refused_by_name(report: dict[str, Any]) -> None:
    assert report["brackets"] == (
        "InputError: /dev/video0 (vivid): has no control of its exposure time"
    )


def test_dropped_buffers_are_gaps_in_the_sequence(report: dict[str, Any]) -> None:
    # Of frames of which each is dropped with probability ½, 19 in a row are kept once in 500,000.
    assert min(gaps(report["dropped"]["sequences"])) == 0
    assert max(gaps(report["dropped"]["sequences"])) > 0


def test_healthy_stream_has_no_damage(report: dict[str, Any]) -> None:
    assert report["healthy"]["damaged"] == 0
    assert len(set(report["healthy"]["bytes"])) == 1


def test_error_flag_marks_one_frame(report: dict[str, Any]) -> None:
    assert report["damaged"]["damaged"] == 1
    assert len(report["damaged"]["sequences"]) == FRAMES


@pytest.mark.parametrize(
    ("injected", "purpose"), [("no buffers", "get buffers"), ("no start", "start streaming")]
)
def test_stream_that_does_not_start_is_told_and_starts_again(
    report: dict[str, Any], injected: str, purpose: str
) -> None:
    assert report[injected]["error"].startswith(f"CameraStalled: /dev/video0: cannot {purpose}")
    assert report[injected]["again"]


@pytest.mark.parametrize("injected", ["no queue", "fatal"])
def test_stream_that_breaks_is_told(report: dict[str, Any], injected: str) -> None:
    assert report[injected].startswith("CameraStalled: /dev/video0: cannot")
    assert report[injected].endswith("the stream has stopped")


def test_disconnected_camera_is_told_and_opens_again(report: dict[str, Any]) -> None:
    assert report["disconnected"].startswith("CameraLost: /dev/video0")
    assert report["reconnected"] is None
