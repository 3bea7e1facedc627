"""A picture whose viewer walks around: a draft in the next frame, then the traced one."""

import threading
import time

import cv2
import msgspec
import numpy as np
import pytest

from capture.radiance import RadianceImage
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.renderer import BakedRenderer
from render.live import picture as live_picture
from render.live.desk import Desk, LiveFrame, Seen, State
from render.live.encoding import encode_frame
from render.live.exposing import ViewExposure
from render.live.models import load_models
from render.live.picture import LivePicture
from render.live.settings import Settings, changed
from render.output.preview import CLIPPED_RGB

MODELS = load_models(())
SIZE_PX = (48, 36)
LIGHTS = LightSet(
    np.array([[0.0, 0.8, -0.6], [0.6, 0.8, 0.0]]), np.array([[3.0, 2.0, 1.0]] * 2), np.full(2, 0.1)
)


def rendered_when_traced(picture, settings):
    """Return the first picture that is no draft, and the drafts before it."""
    drafts = []
    end_s = time.monotonic() + 20
    while time.monotonic() < end_s:
        drawn = picture.render(settings, LIGHTS, None)
        if not picture.is_draft:
            return drawn, drafts
        drafts.append(drawn)
        time.sleep(0.01)
    raise AssertionError("never traced")


def test_a_draft_comes_at_once_and_the_traced_picture_follows(monkeypatch):
    monkeypatch.setattr(live_picture, "RESTING_S", 0.0)
    settings = Settings(model="sphere")
    with LivePicture(MODELS, SIZE_PX) as picture:
        drawn, drafts = rendered_when_traced(picture, settings)
        assert drafts
        moved = changed(settings, {"azimuth_rad": 0.5})
        first = picture.render(moved, LIGHTS, None)
        assert picture.is_draft
        assert first.shape == (18, 24, 4)
        traced, _ = rendered_when_traced(picture, moved)
    scene, camera = MODELS.view(settings, SIZE_PX)
    with BakedRenderer(scene, camera) as baked:
        np.testing.assert_array_equal(drawn, baked.render(LIGHTS, None))
    assert not np.array_equal(drawn, traced)
    # The draft is of the same scene in the same light.
    mean = drawn[..., :3].mean(axis=(0, 1))
    np.testing.assert_allclose(drafts[-1][..., :3].mean(axis=(0, 1)), mean, rtol=0.15)


def test_a_smaller_picture_comes_when_it_is_traced(monkeypatch):
    monkeypatch.setattr(live_picture, "RESTING_S", 0.0)
    monkeypatch.setattr(live_picture, "may_enter_beside", lambda: True)
    settings = Settings(model="sphere")
    with LivePicture(MODELS, SIZE_PX) as picture:
        rendered_when_traced(picture, settings)
        assert picture.is_settled
        seen = []
        while not seen or not picture.is_settled:
            seen.append(picture.render(settings, LIGHTS, None, (24, 18)).shape[:2])
            assert not picture.is_draft
            time.sleep(0.01)
            assert len(seen) < 2000
        smaller = picture.render(settings, LIGHTS, None, (24, 18))
    assert seen[0] == (36, 48), "nothing waits for it"
    assert seen[-1] == (18, 24)
    scene, camera = MODELS.view(settings, (24, 18))
    with BakedRenderer(scene, camera) as baked:
        np.testing.assert_array_equal(smaller, baked.render(LIGHTS, None))


def test_while_the_view_is_moved_nothing_more_is_traced(monkeypatch):
    go_on = threading.Event()
    traced, trace = [], live_picture.BakedRenderer

    def trace_later(scene, camera):
        go_on.wait(20)
        traced.append(trace(scene, camera))
        return traced[-1]

    monkeypatch.setattr(live_picture, "RESTING_S", 60.0)
    monkeypatch.setattr(live_picture, "BakedRenderer", trace_later)
    monkeypatch.setattr(live_picture, "may_enter_beside", lambda: True)
    with LivePicture(MODELS, SIZE_PX) as picture:
        for azimuth_rad in (0.1, 0.2, 0.3):
            settings = Settings(model="sphere", azimuth_rad=azimuth_rad)
            picture.render(settings, LIGHTS, None)
            assert picture.is_draft
        go_on.set()  # the first view of all is traced at once
        while not traced:
            time.sleep(0.01)
        for _ in range(3):
            picture.render(settings, LIGHTS, None)
            assert picture.is_draft, "what was traced was another view"
    assert len(traced) == 1


def test_the_exposure_is_right_at_first_and_then_follows_slowly():
    exposure, grey = ViewExposure(), np.ones((4, 4, 4), np.float32)
    first = exposure.next_ev(None, grey, np.ones(1, np.float32))
    assert first == pytest.approx(np.log2(0.18))
    second = exposure.next_ev(None, grey * [8, 8, 8, 1], np.ones(1, np.float32))
    assert second == pytest.approx(first - 0.3)  # a tenth of three stops
    assert exposure.next_ev(2.5, grey, np.ones(1, np.float32)) == 2.5
    assert ViewExposure().next_ev(None, None, np.full(3, 0.18, np.float32)) == pytest.approx(
        0, abs=1e-6
    )
    assert ViewExposure().next_ev(None, None, np.zeros(0, np.float32)) == 0.0


def test_a_message_holds_its_pictures_whole_with_their_marks():
    radiance = np.full((16, 32, 3), 0.18, np.float32)
    marks = np.zeros((16, 32), np.bool_)
    clipped = marks.copy()
    clipped[:, 16:] = True
    environment = EnvironmentMap(radiance, ~marks, clipped)
    camera = RadianceImage(radiance[:, :16].copy(), 0 * radiance[:, :16], *[~marks[:, :16]] * 2)
    drawn = np.full((8, 10, 4), 0.18, np.float32)
    desk = Desk(Settings(count=3), MODELS)
    frame = LiveFrame(
        5, State("running"), Seen(LIGHTS, camera, environment, drawn, 0.0, True), 0.1, 0.0, {"a": 1}
    )
    desk.answer("saved")
    data = encode_frame(frame, desk)
    length = int.from_bytes(data[:4], "little")
    header = msgspec.json.decode(data[4 : 4 + length])
    pictures, offset = {}, 4 + length
    for name, size in header["parts"].items():
        jpeg = np.frombuffer(data[offset : offset + size], np.uint8)
        pictures[name] = cv2.imdecode(jpeg, cv2.IMREAD_COLOR_RGB).astype(int)
        offset += size
    assert offset == len(data)
    assert (header["number"], header["account"], header["is_draft"]) == (5, {"a": 1}, True)
    assert header["settings"]["count"] == 3
    assert header["notice"]["text"] == "saved"
    assert header["lights"]["irradiance"] == [[3.0, 2.0, 1.0]] * 2
    shapes = {name: picture.shape[:2] for name, picture in pictures.items()}
    assert shapes == {"camera": (16, 16), "map": (16, 32), "picture": (8, 10)}
    grey = 255 * (1.055 * 0.18 ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(pictures["picture"], grey, atol=4)
    np.testing.assert_allclose(pictures["map"][:, :8], grey, atol=8)
    np.testing.assert_allclose(pictures["map"][4, 24], CLIPPED_RGB, atol=25)
