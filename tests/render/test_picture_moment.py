"""A picture's light and the map behind it are of one bracket, in a replay and live.

Lights hold all of a map's light, and no two brackets here are equally bright: where the two are as
bright, they are of one moment.
"""

import json

import numpy as np
import pytest

from capture.frame import Exposure
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor
from lighting.stream.light_stream import LightPlan
from render import replay as replaying
from render import replay_pictures
from render.live.settings import Settings
from render.scenes.default_scene import default_scene
from tests.render.live_recording import CALIBRATION, SIZE_PX
from tests.render.live_run import run

LEVELS = (60, 200, 90, 140, 30)


@pytest.fixture
def recording(tmp_path):
    """A room of one grey, seen nearly all around, that changes by a third and more."""
    lens = CALIBRATION | {"focal_px": 9.0, "valid_angle_rad": 2.6}
    (tmp_path / "cal.json").write_text(json.dumps(lens))
    shape = (SIZE_PX[1], SIZE_PX[0], 3)
    with create_recording(
        tmp_path / "r", "", assumed_sensor(np.uint8), calibration=tmp_path / "cal.json"
    ) as writer:
        for number, level in enumerate(LEVELS):
            picture = np.full(shape, level, np.uint8)
            writer.write_frame(picture, Exposure(0.01), 0.5 * number, number)
    return open_recording(tmp_path / "r")


def assert_of_one_moment(drawn):
    assert len(drawn) == len(LEVELS)
    of_lights = np.array([lights.integral() for lights, _ in drawn])
    of_maps = np.array([environment.integral() for _, environment in drawn])
    np.testing.assert_allclose(of_lights, of_maps, rtol=0.02)
    changes = np.abs(np.diff(np.log(of_maps), axis=0))
    assert changes.min() > 0.3


def test_in_a_replay(recording, tmp_path, monkeypatch):
    drawn = []

    class Recorder(replay_pictures.SceneRenderer):
        def render(self, scene, camera, lights, background=None, *, through_ground=False):
            drawn.append((lights, background))
            return np.ones((camera.size_px[1], camera.size_px[0], 4), np.float32)

    monkeypatch.setattr(replay_pictures, "SceneRenderer", Recorder)
    scene, camera = default_scene((16, 12))
    summary = replaying.replay(
        recording.folder, tmp_path / "out", LightPlan(8, is_steady=False), scene=scene,
        camera=camera, map_height=32, through_ground=True,
    )  # fmt: skip
    assert_of_one_moment(drawn)
    # Ground as bright as all the rest sends back all of the light.
    np.testing.assert_allclose(summary.albedo.reflectance, 1, rtol=0.02)
    assert summary.albedo.seen_share > 0.5


def test_live(recording):
    ran = run(recording, len(LEVELS), settings=Settings(count=20, is_steady=False))
    assert_of_one_moment([(lights, background) for _, lights, background in ran.drawn])
