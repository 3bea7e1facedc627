"""What open_camera finds, simulated: GREY pictures of 16 × 16 px, exposed as a control says."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import capture.v4l2.camera
from capture.v4l2.camera import BracketCamera
from capture.v4l2.stream import Delivery
from tests.capture.simulated_camera import SimulatedCamera
from tests.capture.simulated_node import EXPOSURE, SimulatedNode

TIMES_S = (0.0005, 0.004, 0.03)


class PictureStream(SimulatedCamera):
    """Sends pictures of SCENE; `truth_s` holds their exposures by sequence number."""

    truth_s: dict[int, float]
    closed = 0

    def next_frame(self, timeout_s: float) -> Delivery | None:
        delivery = super().next_frame(timeout_s)
        if delivery is None:
            return None
        self.truth_s[delivery.sequence] = self.exposure_of(delivery.data)
        return replace(delivery, data=self.look(delivery.data).tobytes())

    def close(self) -> None:
        self.closed += 1


class Rig:
    """What open_camera finds: a node whose exposure control acts on a stream."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **stream: Any) -> None:
        self.stream = PictureStream(**stream)
        self.stream.truth_s = {}
        self.node: Any = SimulatedNode(
            formats={"GREY": [(16, 16), (15, 16)]}, intervals=[(1, 30)], present=("GREY", 16, 16)
        )
        self.node.given = {"bytesperline": 16}
        self.node.closed = 0
        self.node.close = self._close_node
        self.node.control(EXPOSURE).keeps = lambda value: round(
            self.stream.set_exposure(value * 1e-4) * 1e4
        )
        module = capture.v4l2.camera
        monkeypatch.setattr(module, "find_camera", lambda device: device)
        monkeypatch.setattr(module, "VideoNode", lambda path: self.node)
        monkeypatch.setattr(module, "VideoStream", lambda node: self.stream)

    def _close_node(self) -> None:
        self.node.closed += 1

    def mislabelled(
        self, camera: BracketCamera, brackets: int, times_s: tuple[float, ...] = TIMES_S
    ) -> int:
        """Take brackets and return how many of their frames were not exposed as they say."""
        frames = [frame for _ in range(brackets) for frame in camera.capture_undecoded(times_s)]
        return sum(
            not np.isclose(frame.exposure.time_s, self.stream.truth_s[frame.index])
            for frame in frames
        )
